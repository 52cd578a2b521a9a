/* What the sensor saw, beside the plan: the frame, panoramas with the slots on them, tables. */

function table(caption, heads, rows) {
  const head = make("tr", {}, ...heads.map(text => make("th", {scope: "col"}, text)));
  const said = make("caption", {}, make("span", {}, caption));
  return make("table", {}, said, make("thead", {}, head), make("tbody", {}, ...rows));
}

function row(head, cells, attributes = {}) {
  return make("tr", attributes, make("th", {scope: "row"}, head), ...cells.map(text => make("td", {}, text)));
}

function nodeName(nodes, index) {
  const node = nodes[index];
  return node ? (node[1] && node[1] !== node[0] ? `${node[0]} ${node[1]}` : node[0]) : "none";
}

function showFrame(figure, url, frame) {
  const [image, none] = figure.children;
  image.hidden = !url;
  none.hidden = Boolean(url);
  if (!url) return;
  const stage = figure.closest(".stage");
  image.onload = () => stage.classList.toggle("broad", image.naturalWidth > 3 * image.naturalHeight);
  image.src = url;
  image.alt = `Picture of the camera at frame ${frame}`;
}

function showHypotheses(into, look, nodes) {
  const rows = (look ? look[1] : []).map(([node, match, likelihood, x, y, heading]) => row(nodeName(nodes, node),
    [fixed(match / 1000), fixed(likelihood / 100), `${fixed(x / 100)}, ${fixed(y / 100)}`, degrees(heading)]));
  if (rows.length) {
    const heads = ["node", "match", "log-likelihood", "x, y (m)", "heading"];
    into.replaceChildren(table(`The sensor's best hypotheses at frame ${look[0]}`, heads, rows));
  } else {
    const why = look ? look[3] || "the frame says nothing" : "no look of the sensor is kept";
    into.replaceChildren(make("p", {class: "none"}, `No hypothesis: ${why}.`));
  }
}

/* Where a heading lies on a panorama: columns run clockwise from that of the first one. */
function share(node, heading) {
  return (((node[4] - heading) / 360) % 1 + 1) % 1;
}

/* A slot, in two pieces where it goes round. */
function slotBoxes([, , width, lefts, values, counted], index) {
  const left = lefts[index] / 100, wide = width / 100;
  const style = at => `left:${at}%;width:${wide}%;--value:${(values[index] / 10).toFixed(0)}%`;
  const kind = counted[index] ? "slot counted" : "slot";
  const box = at => make("span", {class: kind, style: style(at)}, String(index + 1));
  return left + wide > 100 ? [box(left), box(left - 100)] : [box(left)];
}

function slotWords([, match, , , values, counted]) {
  const aside = index => counted[index] ? "" : " (does not count)";
  const list = values.map((value, index) => `${index + 1}: ${fixed(value / 1000)}${aside(index)}`);
  return `Match ${fixed(match / 1000)}; correlation of the frame's slots, ${list.join(", ")}.`;
}

function panorama(node, url, title, slots, truth, guess) {
  const marks = [["truth", truth], ["guess", guess]].filter(([, heading]) => heading !== null).map(([name, heading]) =>
    make("span", {class: `mark ${name}`, style: `left:${100 * share(node, heading)}%`}));
  const boxes = slots ? slots[3].flatMap((_, index) => slotBoxes(slots, index)) : [];
  const words = slots ? slotWords(slots) : "";
  const image = make("img", {src: url, alt: `Panorama: ${title}. ${words}`});
  const strip = make("div", {class: "strip"}, image, ...boxes, ...marks);
  const scroll = make("div", {class: "wide", tabindex: "0", role: "region", "aria-label": `Panorama: ${title}`}, strip);
  return make("figure", {}, make("figcaption", {}, make("b", {}, title), words ? ` ${words}` : ""), scroll);
}

/* Panoramas of the node that the estimate names, and of the best match if that is another. */
function showPanoramas(into, scene, look, answer, truth) {
  const best = look && look[1].length ? look[1][0][0] : -1;
  const wanted = best === answer[NODE] ? [[best, "named by the estimate, best match"]]
    : [[answer[NODE], "named by the estimate"], [best, "best match"]];
  const pictured = wanted.filter(([index]) => scene.nodes[index] && scene.nodes[index][5] >= 0);
  const figures = pictured.map(([index, why]) => {
    const slots = look && look[2].find(one => one[0] === index);
    const title = `node ${nodeName(scene.nodes, index)}, ${why}`;
    return panorama(scene.nodes[index], scene.pictures[scene.nodes[index][5]], title, slots, truth[2], answer[HEADING]);
  });
  const boxes = look && look[2].length ? " Numbered boxes: where the slots of the frame were found; the stronger the " +
    "colour, the better the match; those in a thick yellow frame count." : "";
  const key = make("p", {class: "note"}, make("i", {class: "key truth"}), " the robot's true heading ",
    make("i", {class: "key guess-line"}), ` the estimate's.${boxes}`);
  into.replaceChildren(...figures, ...(figures.length ? [key] : []));
}

/* A step without a winner has no deviations. */
function deviation(lengths, angles, from) {
  return lengths && from in lengths ? `${fixed(lengths[from] / 100)} m, ${degrees(angles[from])}` : "–";
}

/* Table 5.7: destinations in rows, and how far each deviates from each origin. */
function showAccount(into, scene, account) {
  into.replaceChildren();
  if (!account) return;
  const [kind, origins, destinations, winner, lengths, angles] = account;
  const named = line => `${nodeName(scene.nodes, line[0])}${line[4] ? " (virtual)" : ""}`;
  const origin = line => make("span", {}, `from ${named(line)}`,
    make("small", {}, `${degrees(line[1])}, activity ${fixed(line[3] / 1000)}`));
  const heads = ["destination", "heading", "match", "activity", ...origins.map(origin)];
  const rows = destinations.map((line, index) => {
    const own = [degrees(line[1]), line[2] === null ? "–" : fixed(line[2] / 1000), fixed(line[3] / 1000)];
    const from = origins.map((_, place) => deviation(lengths[index], angles[index], place));
    const wins = index === winner;
    return row(named(line) + (wins ? " ◀ wins" : ""), [...own, ...from], wins ? {class: "winner"} : {});
  });
  const caption = `How the tracker decided, a ${scene.codes[2][kind]} step: how far distance and turn of each ` +
    "destination from each origin deviate from the odometer's (Δl, Δφ)";
  into.append(table(caption, heads, rows));
}
