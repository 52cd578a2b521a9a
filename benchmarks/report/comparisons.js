/* "Which of two?": looks up what was computed when the report was written. */

const VERDICTS = ["no difference told", "A is better", "B is better", "too few seeds to tell", "one drive: not told",
  "not known of both"];
const COMPARED = ["node accuracy", "median position error (m)"];

/* Entry of pairs a and b, the second less the first; they are stored once, the lower index first. */
function entryOf(all, a, b, scenario, metric) {
  const [low, high] = a < b ? [a, b] : [b, a];
  const pair = low * all.pairs - low * (low + 1) / 2 + high - low - 1;
  const entry = all.entries[(pair * all.scenarios.length + scenario) * 2 + metric];
  if (!entry || a < b) return entry;
  const [mean, from, to, seeds, verdict] = entry;
  const turned = value => value === null ? null : -value;
  return [turned(mean), turned(to), turned(from), seeds, [0, 2, 1][verdict] ?? verdict];
}

const isKnown = entry => Boolean(entry) && entry[0] !== null;

function comparisonCells(entry, metric) {
  const label = {"data-label": COMPARED[metric]};
  if (!isKnown(entry)) return [make("td", label, "–"), make("td", {}, "not known of both")];
  const [mean, low, high, seeds, verdict] = entry;
  const ends = low === null ? "" : ` [${fixed(low / 1000)}, ${fixed(high / 1000)}]`;
  const sign = mean > 0 ? "+" : "";
  const cell = make("td", label, make("b", {}, sign + fixed(mean / 1000)), make("small", {}, ends));
  const words = VERDICTS[verdict] + (verdict === 3 ? ` (${seeds})` : "");
  return [cell, make("td", {class: `verdict v${verdict}`}, words)];
}

function compare(root, all) {
  const [a, b] = ["first", "second"].map(role => Number(part(root, role).value)), rows = [], missing = [];
  const message = words => make("tr", {}, make("td", {colspan: 5}, words));
  all.scenarios.forEach((name, scenario) => {
    const entries = [0, 1].map(metric => entryOf(all, a, b, scenario, metric));
    if (!entries.some(isKnown)) missing.push(name);
    else rows.push(make("tr", {}, make("th", {scope: "row"}, name), ...entries.flatMap(comparisonCells)));
  });
  const none = a === b ? "choose two different pairs" : "no scenario has results of both";
  root.querySelector("tbody").replaceChildren(...(a !== b && rows.length ? rows : [message(none)]));
  part(root, "not-both").textContent = a !== b && rows.length && missing.length
    ? `Without results of both, and left out: ${missing.join(", ")}.` : "";
}

for (const root of parts(document, "comparison")) {
  const all = data(root, "comparisons");
  root.addEventListener("change", () => compare(root, all));
  compare(root, all);
}
