/* What moves on the plan of a replay. Answers are lists as compact.py of the report writes them. */

const KIND = 0, X = 1, Y = 2, HEADING = 3, NODE = 4, PROBABILITY = 5, STATUS = 6, VERDICT = 7, BELIEF = 8, ACCOUNT = 9;
const LARGEST_DISC = 34;

function arrow(plan, [x, y, heading], size, name) {
  const d = `M${size} 0L${-0.7 * size} ${0.65 * size}L${-0.35 * size} 0L${-0.7 * size} ${-0.65 * size}z`;
  return draw(plan, "path", {class: name, d, transform: `translate(${x} ${-y}) rotate(${-heading})`});
}

/* The last frame up to this one at which the gate was open; -1 where there is none. */
function lastUpdate(answers, step, gated) {
  for (let at = step; at >= 0; at--) if (answers[at][KIND] !== gated) return at;
  return -1;
}

function showBelief(plan, unit, answer) {
  const cells = answer ? answer[BELIEF] : [], discs = [];
  for (let at = 0; at < cells.length; at += 3) {
    const r = LARGEST_DISC * unit * Math.sqrt(cells[at + 2] / 1000);
    discs.push(draw(plan, "circle", {cx: cells[at], cy: -cells[at + 1], r: r.toFixed(1)}));
  }
  part(plan, "belief").replaceChildren(...discs);
}

const MARKS = {
  right: (x, y) => `M${x} ${y}h0`,
  adjacent: (x, y, r) => `M${x} ${y - 1.3 * r}l${1.3 * r} ${1.3 * r}l${-1.3 * r} ${1.3 * r}l${-1.3 * r} ${-1.3 * r}z`,
  wrong: (x, y, r) => `M${x - r} ${y - r}l${2 * r} ${2 * r}m0 ${-2 * r}l${-2 * r} ${2 * r}`,
};

/* All estimates so far: one path of dots, one of diamonds, one of crosses. */
function showAnswers(plan, unit, answers, verdicts) {
  const paths = verdicts.map((name, verdict) => draw(plan, "path", {class: name, d: answers
    .filter(answer => answer[VERDICT] === verdict)
    .map(answer => MARKS[name](answer[X], -answer[Y], 3 * unit)).join("")}));
  part(plan, "answers").replaceChildren(...paths);
}

function showPoses(plan, unit, truth, answer, node) {
  const shapes = [arrow(plan, truth, 11 * unit, "now")];
  if (answer) {
    const guess = [answer[X], answer[Y], answer[HEADING]];
    const gap = `M${truth[0]} ${-truth[1]}L${guess[0]} ${-guess[1]}`;
    shapes.unshift(draw(plan, "path", {class: "gap", d: gap}));
    shapes.push(arrow(plan, guess, 11 * unit, "guess"));
  }
  if (node) shapes.unshift(draw(plan, "circle", {class: "named", cx: node[2], cy: -node[3], r: 9 * unit}));
  part(plan, "poses").replaceChildren(...shapes);
}
