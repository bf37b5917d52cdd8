"""How a notebook shows an answer: sentences first, every field once, and nothing of it as markup."""

from service.client.clutchlife.answers import ServiceAnswer


def test_an_answer_is_a_dictionary_that_notebooks_show_as_a_table() -> None:
    answer = ServiceAnswer(
        clutch_id="<b>bench</b>",
        headline="Normal: safe for 2,600 more cycles (95 %)",
        action="Nothing to do: carry on testing.",
        at_least=2612.25,
        held=0,
        archived=False,
        recent=None,
        remaining_cycles={"0.05": 2612.25, "0.5": None},
        effects=["oil_temperature", "film"],
        warnings=[],
        items=[{"code": "x"}],
    )
    shown = answer._repr_html_()
    assert answer == dict(answer)
    assert shown.startswith(
        "<p>Normal: safe for 2,600 more cycles (95 %)</p><p>Nothing to do: carry on testing.</p><table>"
    )
    for cell in (
        "<th>clutch id</th><td>&lt;b&gt;bench&lt;/b&gt;</td>",
        "<th>at least</th><td>2,612.25</td>",
        "<th>held</th><td>0</td>",
        "<th>archived</th><td>no</td>",
        "<th>recent</th><td>–</td>",
        "<th>remaining cycles</th><td>0.05: 2,612.25; 0.5: –</td>",
        "<th>effects</th><td>oil_temperature, film</td>",
        "<th>warnings</th><td>0 items</td>",
        "<th>items</th><td>1 items</td>",
    ):
        assert cell in shown, cell
    assert shown.count("<tr>") == len(answer) - 2
