"""Sets of outlying runs that the first search overlooked.

The first lattice is blurred, and a run that is three deviations off is less far off a blurred course. Once the lattices
have closed in nothing is blurred any more: the gain of turning a run is computed again at nodes of the leading kinds, and
the sets with a sufficient gain get lattices where those kinds have theirs.

A set that is overlooked would not only lack its share of the posterior: it would also bias the scatter, which then has
to explain the run.
"""

import numpy as np

from models.arrays import FloatArray
from models.tracking.courses import scatter_growth
from models.tracking.criteria import MOST
from models.tracking.filters.lattice import COARSE, Frame, Kinds, joined, log_density, log_masses, shrunk, tabled
from models.tracking.history import History
from models.tracking.linear_model import log_outlying
from models.tracking.outlying_runs import TEMPER, Nodes, gains
from models.tracking.prior import Prior

#: Nodes of each leading kind.
_NODES = 32


def completed(prior: Prior, history: History, kinds: Kinds, frame: Frame, log_mass: FloatArray) -> tuple[Kinds, Frame]:
    """The kinds and their lattices, with those of the sets that were overlooked; `log_mass` [k] says which kinds lead."""
    if prior.outlying_share == 0.0 or history.value.size < 2:
        return kinds, frame
    leaders = np.argsort(-log_mass, kind="stable")[:3]  # the three that lead
    leading, where = kinds.taken(leaders), frame.taken(leaders)
    table = tabled(where, COARSE[0], history, leading.course)
    density = log_density(prior, history, leading, where, table)
    mass = density + np.log(where.cells(COARSE[0]))[:, None, :, None]
    mass -= log_masses(density, where.cells(COARSE[0])).max()
    laid = {_name(form, outlying) for form, outlying in zip(kinds.form, kinds.outlying, strict=True)}
    relative = history.relative(prior)
    overlooked: dict[bytes, tuple[float, int, FloatArray]] = {}
    for leader in range(leaders.size):
        gain = gains(prior, history, leading.outlying[leader], _nodes(leading, where, table, mass, leader, relative))
        for run in np.flatnonzero(gain > -3.0).tolist():
            outlying = leading.outlying[leader].copy()
            outlying[run] = 1.0 - outlying[run]
            name = _name(leading.form[leader], outlying)
            if name not in laid and gain[run] > overlooked.get(name, (-np.inf,))[0]:
                overlooked[name] = (float(gain[run]), leader, outlying)
    if not overlooked:
        return kinds, frame
    best = sorted(overlooked.values(), key=lambda candidate: candidate[0], reverse=True)[:MOST]
    of, outlying = np.array([leader for _, leader, _ in best]), np.stack([runs for _, _, runs in best])
    weight = leading.log_weight[of] - log_outlying(prior, leading.outlying[of].T) + log_outlying(prior, outlying.T)
    more, there = Kinds(form=leading.form[of], outlying=outlying, log_weight=weight), where.taken(of)
    closer = shrunk(there, log_density(prior, history, more, there, table[of]))
    return joined(kinds, more), joined(frame, closer)


def _nodes(kinds: Kinds, frame: Frame, table: FloatArray, mass: FloatArray, kind: int, relative: FloatArray) -> Nodes:
    """NODES nodes of one kind, drawn evenly by a power of their log mass so that what an
    outlying run hides is among them."""
    cells = mass.shape[2] * mass.shape[3]
    flat = mass[kind].ravel()
    edges = np.cumsum(np.exp(TEMPER * (flat - flat.max())))
    drawn = np.searchsorted(edges, (np.arange(_NODES) + 0.5) / _NODES * edges[-1])
    log_share = np.log(_NODES) + TEMPER * (flat[drawn] - flat.max()) - np.log(edges[-1])
    level, cell = np.divmod(drawn, cells)
    return Nodes(
        b=table[kind][:, cell].T,
        noise=np.exp(2.0 * frame.log_scatter[kind, level])[:, None] * scatter_growth(kinds.form[[kind]], relative),
        size=np.full(_NODES, kinds.size[kind]),
        log_weight=flat[drawn] - log_share,
    )


def _name(form: int, outlying: FloatArray) -> bytes:
    return np.append(outlying, form).tobytes()
