"use strict";
/* Uses a report as a reader would, and leaves what came of it in the page for test_report_in_browser.py. */

const outcome = {};
const wait = ms => new Promise(done => setTimeout(done, ms));
const shown = element => element.getClientRects().length > 0;

function fire(element, type, extra = {}) {
  element.dispatchEvent(Object.assign(new Event(type, {bubbles: true, cancelable: true}), extra));
}

function press(element, key) {
  return !element.dispatchEvent(new KeyboardEvent("keydown", {key, bubbles: true, cancelable: true}));
}

function select(element, value) {
  element.value = value;
  fire(element, "change");
}

function sorting() {
  return [...document.querySelectorAll("table.sortable")].map(table => [...table.tHead.rows[0].cells].map(head => {
    const button = head.querySelector("button"), found = {name: button.textContent, orders: []};
    button.focus();
    found.focused = document.activeElement === button && button.tabIndex === 0;
    for (let turn = 0; turn < 2; turn++) {
      button.click();
      const cells = [...table.tBodies[0].rows].map(row => row.cells[head.cellIndex]);
      found.orders.push([head.getAttribute("aria-sort"), cells.map(cell => cell.dataset.value ?? cell.textContent)]);
    }
    found.sorted = table.querySelectorAll("th[aria-sort]").length;
    return found;
  }));
}

function comparisons() {
  const root = document.querySelector('[data-role="comparison"]'), found = [];
  const [a, b] = ["first", "second"].map(role => root.querySelector(`[data-role="${role}"]`));
  for (const one of a.options) for (const two of b.options) {
    select(a, one.value);
    select(b, two.value);
    const rows = [...root.querySelectorAll("tbody tr")].map(row => [...row.cells].map(cell => cell.textContent));
    const left = root.querySelector('[data-role="not-both"]').textContent;
    found.push([one.textContent, two.textContent, left, rows]);
  }
  return found;
}

/* Space, Home and End with the focus on each control, and what is left to the browser. */
function anywhere(role, step) {
  const found = {}, label = () => role("play").getAttribute("aria-label");
  const controls = ["scrub", "first", "back", "play", "forward", "last", "hypotheses"].map(role);
  found.jumps = controls.map(one => [press(one, "End"), step(), press(one, "Home"), step()]);
  found.space = controls.map(one => [press(one, " "), label(), press(one, " "), label(), step()]);
  const letGo = new KeyboardEvent("keyup", {key: " ", bubbles: true, cancelable: true});
  found.letGo = !role("play").dispatchEvent(letGo);
  found.slider = ["ArrowRight", "ArrowRight", "ArrowLeft"].map(key => [press(role("scrub"), key), step()]);
  found.left = [press(role("sensor"), "End"), press(role("sensor"), " "), press(role("hypotheses"), "ArrowRight"), step()];
  press(role("scrub"), "Home");
  return found;
}

async function replay(root) {
  const role = name => root.querySelector(`[data-role="${name}"]`), found = {};
  const step = () => parseInt(role("status").textContent.match(/^Frame (\d+)/)[1], 10);
  const picture = () => root.querySelector(".plan").outerHTML;
  found.start = [step(), role("status").textContent, role("frame").querySelector("img").src.slice(0, 11)];
  const buttons = ["forward", "forward", "back", "last", "forward", "first", "back"];
  found.buttons = buttons.map(name => (role(name).click(), step()));
  found.keys = ["ArrowRight", "ArrowRight", "ArrowLeft", "End", "Home"].map(key => (press(root, key), step()));
  found.anywhere = anywhere(role, step);
  found.words = [1, 2, 3, 4, 0].map(frame => {
    role("scrub").value = frame;
    fire(role("scrub"), "input");
    return role("status").textContent.match(/named[^;]*/)[0];
  });
  role("last").click();
  found.marks = [...role("answers").children].map(one => [one.getAttribute("class"), one.getAttribute("d")]);
  role("scrub").value = 4;
  fire(role("scrub"), "input");
  found.slider = [step(), role("scrub").value];
  const before = picture();
  select(role("estimator"), "1");
  found.estimator = [picture() !== before, step(), role("account").textContent];
  select(role("estimator"), "0");
  found.back = picture() === before;
  found.account = role("account").textContent;
  const slots = [...role("panoramas").querySelectorAll(".slot")];
  found.slots = slots.map(slot => [slot.style.left, slot.className, slot.textContent]);
  select(role("sensor"), "1");
  found.sensor = [role("panoramas").querySelectorAll(".slot").length, role("command").textContent];
  select(role("sensor"), "0");
  role("last").click();
  found.without = [role("frame").querySelector("img").hidden, shown(role("frame").querySelector("p"))];
  role("first").click();
  press(root, " ");
  found.playing = [role("play").getAttribute("aria-label"), role("status").getAttribute("aria-live")];
  await wait(1200);
  found.moved = step();
  role("play").click();
  const paused = step();
  await wait(1200);
  found.paused = [step() - paused, role("play").getAttribute("aria-label"), role("status").getAttribute("aria-live")];
  role("play").click();
  await wait(6000);
  found.ended = [step(), role("play").getAttribute("aria-label")];
  return found;
}

function choosers() {
  return [...document.querySelectorAll('[data-role="chooser"]')].map(root => {
    const selects = [...root.querySelectorAll("select")], seen = [];
    const visible = () => [...root.querySelectorAll("[data-choice]")].filter(shown);
    const look = () => seen.push(visible().map(one => one.dataset.choice));
    look();
    for (const one of selects) {
      select(one, "1");
      look();
    }
    for (const one of selects) select(one, "0");
    return seen;
  });
}

function legend() {
  const chart = document.querySelector(".chart"), button = chart.querySelector("button[data-line]");
  const ahead = () => [...chart.querySelectorAll("g.ahead")].map(line => line.dataset.line);
  const found = [ahead()];
  for (const act of ["mouseenter", "mouseleave", "focus", "blur"]) {
    button.dispatchEvent(new Event(act));
    found.push(ahead());
  }
  for (let turn = 0; turn < 2; turn++) {
    button.click();
    found.push([ahead(), button.getAttribute("aria-pressed")]);
  }
  return found;
}

function nameless() {
  const label = one => one.labels && one.labels.length ? one.labels[0].textContent : "";
  const name = one => one.getAttribute("aria-label") || label(one) || one.textContent;
  const controls = [...document.querySelectorAll("button, input, select, summary, a, [tabindex], [role]")];
  const pictures = [...document.querySelectorAll("img, svg")].filter(one => !(one.closest("[hidden]") ||
    one.closest("[aria-hidden=true]") || one.getAttribute("alt") || one.getAttribute("aria-label")));
  return [...controls.filter(one => one.tagName !== "PRE" && !name(one).trim()), ...pictures].map(one => one.outerHTML);
}

async function copying() {
  const button = document.querySelector('#again [data-role="copy"]'), found = [];
  const refuse = async () => { throw new Error("refused"); };
  for (const writeText of [async text => found.push(text), refuse]) {
    Object.defineProperty(navigator, "clipboard", {value: {writeText}, configurable: true});
    button.click();
    await wait(100);
    found.push(button.textContent);
    await wait(3000);
  }
  return [...found, String(getSelection()), button.textContent];
}

async function probe() {
  outcome.nameless = nameless();
  outcome.headings = [...document.querySelectorAll("h1, h2, h3, h4")].map(one => Number(one.tagName[1]));
  outcome.sorting = sorting();
  outcome.comparisons = comparisons();
  outcome.choosers = choosers();
  outcome.legend = legend();
  outcome.replays = [];
  for (const root of document.querySelectorAll("section.replay")) outcome.replays.push(await replay(root));
  outcome.copying = await copying();
  outcome.namelessAfter = nameless();
}

probe().catch(error => window.problems.push(String(error.stack))).then(() => {
  const pre = document.createElement("pre");
  pre.id = "outcome";
  pre.textContent = JSON.stringify({...outcome, problems: window.problems});
  document.body.append(pre);
});
