// What stands first on a clutch's page: its name, what is known and what to do, both as the service says them.

import { raisedNotices } from "../alarms/raised.js";
import { limitText, placeText } from "../quantities/criteria.js";
import { h, menu } from "../shared/dom.js";
import { counted, fixed, percent, words } from "../shared/format.js";
import { colourOf, heldText, stateIcon } from "../shared/state.js";

/**
 * @param {ClutchOut} clutch
 * @param {{ archive: () => unknown, end: () => unknown, edit: () => unknown, copy: () => unknown, refresh: () => unknown }} asks
 *   whether the clutch is to be archived; about its end, its record, another like it; for the clutch once more
 * @returns {HTMLElement[]}
 */
export function head(clutch, { archive, end, edit, copy, refresh }) {
  const { state, headline, action } = clutch;
  const [word, ...rest] = headline.split(": ");
  const simulated = clutch.origin === "simulated" && h("span.tag", "simulated");
  const ended = clutch.summary?.ended ?? null;
  return [
    h(
      "div.title",
      h(
        "div.row.name",
        h("h1", clutch.clutch_id, simulated),
        !clutch.archived &&
          menu("More", [
            { label: "Edit the record …", onclick: edit },
            { label: "Register another like it …", onclick: copy },
            ...(clutch.summary ? [{ label: ended ? "Take the end back …" : "End of life …", onclick: end }] : []),
            { label: "Archive …", onclick: archive },
          ]),
      ),
      h(
        "p",
        { class: "row verdict state", style: colourOf(state.name), id: "headline" },
        stateIcon(state.name),
        h("b", word),
        h("span.says", rest.join(": ")),
        clutch.held > 0 && h("a", { href: "#/overview", class: "mark-held" }, heldText(clutch.held)),
      ),
      h("p.action", { id: "action" }, action),
      ...raisedNotices(clutch.alarms, refresh),
      h("p.quiet.description", description(clutch), clutch.note && `; ${clutch.note}`),
    ),
  ];
}

/** @param {ClutchOut} clutch */
function description({ friction_material: material, reaction_plate: plate, fluid, geometry, end_of_life: end }) {
  const { inner_diameter_mm: inner, outer_diameter_mm: outer, friction_faces: faces } = geometry;
  const disc = `${fixed(inner)}/${fixed(outer)} mm, ${counted(faces, "face")}`;
  const limits = end.criteria.map((criterion) => `${placeText(criterion)} (${limitText(criterion)})`);
  const limit =
    limits.length > 0
      ? `end of life at the first of ${limits.join(" and ")}`
      : `end of life at ${percent(end.cof_fraction)} of the new mean COF`;
  return `${words(material)} on ${plate}, ${fluid}; ${disc}; ${limit}`;
}
