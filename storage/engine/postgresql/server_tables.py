"""The tables that a server has beside those of `storage/tables.py`, which every database has."""

from sqlalchemy import BigInteger, Column, MetaData, Table, update

server_tables = MetaData()
#: One row: how many transactions that changed something were committed. Each raises it as its last statement, while it alone
#: writes, so that who reads a number also sees all that was committed up to it; the numbers of a sequence do not promise it.
#: PostgreSQL's alone: SQLite has `PRAGMA data_version`.
commits = Table("commits", server_tables, Column("number", BigInteger, primary_key=True, autoincrement=False))
count_commit = update(commits).values(number=commits.c.number + 1)
