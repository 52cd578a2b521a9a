/* The player of a replay: which frame is shown, and how one gets to another. */

class Replay {
  constructor(root, pictures) {
    this.root = root;
    this.scene = {...data(root, "replay-data"), pictures};
    this.plan = root.querySelector(".plan");
    this.unit = Number(this.plan.dataset.unit);
    this.label = this.plan.getAttribute("aria-label");
    this.last = this.scene.truth.length - 1;
    this.gated = this.scene.codes[0].indexOf("gated");
    this.timer = null;
    this.listen();
    this.show(0);
  }

  listen() {
    const jumps = {first: () => 0, back: () => this.step - 1, forward: () => this.step + 1, last: () => this.last};
    for (const [role, to] of Object.entries(jumps)) this.on(role, "click", () => this.jump(to()));
    this.on("play", "click", () => this.toggle());
    this.on("scrub", "input", () => this.jump(Number(part(this.root, "scrub").value)));
    for (const role of ["sensor", "estimator"]) this.on(role, "change", () => this.show(this.step));
    this.root.addEventListener("keydown", event => this.key(event));
    this.root.addEventListener("keyup", event => this.release(event));
  }

  on(role, event, act) {
    part(this.root, role).addEventListener(event, act);
  }

  /* Selects keep their keys, and boxes that scroll sideways their arrows. */
  key(event) {
    const acts = {ArrowLeft: () => this.jump(this.step - 1), ArrowRight: () => this.jump(this.step + 1),
      Home: () => this.jump(0), End: () => this.jump(this.last),
      " ": () => { if (!event.repeat) this.toggle(); }};
    const theirs = event.target.matches("select") || event.key.startsWith("Arrow") && event.target.matches(".wide");
    if (theirs || event.ctrlKey || event.altKey || event.metaKey || !acts[event.key]) return;
    event.preventDefault();
    acts[event.key]();
  }

  /* Some browsers press a button when space is let go, though the key has been used already. */
  release(event) {
    if (event.key === " " && event.target.matches("button")) event.preventDefault();
  }

  toggle() {
    if (this.timer === null) this.play();
    else this.pause();
  }

  jump(step) {
    this.pause();
    this.show(step);
  }

  play() {
    if (this.step === this.last) this.show(0);
    this.mark("Pause", "off");
    const tick = () => {
      this.show(this.step + 1);
      if (this.step === this.last) this.pause();
      else this.wait(tick);
    };
    this.wait(tick);
  }

  wait(tick) {
    this.timer = setTimeout(tick, 1000 / parseInt(part(this.root, "speed").selectedOptions[0].textContent, 10));
  }

  pause() {
    clearTimeout(this.timer);
    this.timer = null;
    this.mark("Play", "polite");
  }

  /* While it plays, nobody wants every frame read out. */
  mark(label, live) {
    part(this.root, "play").setAttribute("aria-label", label);
    part(this.root, "status").setAttribute("aria-live", live);
  }

  show(step) {
    this.step = Math.min(Math.max(step, 0), this.last);
    const {scene, root} = this, truth = scene.truth[this.step];
    const [sensor, estimator] = ["sensor", "estimator"].map(role => Number(part(root, role).value));
    const answers = scene.answers[sensor][estimator], known = Array.isArray(answers) && answers.length > this.last;
    const answer = known ? answers[this.step] : null;
    this.showPlan(truth, known ? answers : [], answer);
    this.showSeen(truth, known ? answers : [], answer, scene.looks[sensor]);
    const why = Array.isArray(answers) ? "it has fewer answers than the drive has frames" : answers;
    const words = known ? this.words(answer, truth) : `no replay of this pair: ${why}`;
    part(root, "status").textContent = `Frame ${this.step} of ${this.last}: ${words}.`;
    this.plan.setAttribute("aria-label", `${this.label} Frame ${this.step}: ${words}.`);
    part(root, "scrub").value = this.step;
    part(root, "command").textContent = scene.commands[sensor][estimator].replace(/\d+$/, this.step);
  }

  showPlan(truth, answers, answer) {
    const at = answer ? lastUpdate(answers, this.step, this.gated) : -1;
    showBelief(this.plan, this.unit, answers[at]);
    showAnswers(this.plan, this.unit, answers.slice(0, this.step + 1), this.scene.codes[3]);
    showPoses(this.plan, this.unit, truth, answer, answer && this.scene.nodes[answer[NODE]]);
  }

  showSeen(truth, answers, answer, looks) {
    const {scene, root} = this;
    const look = looks.filter(one => one[0] <= this.step).pop();
    const updated = answer ? answers[lastUpdate(answers, this.step, this.gated)] : null;
    showFrame(part(root, "frame"), scene.pictures[scene.frames[this.step]], this.step);
    showHypotheses(part(root, "hypotheses"), look, scene.nodes);
    if (answer) showPanoramas(part(root, "panoramas"), scene, look, answer, truth);
    else part(root, "panoramas").replaceChildren();
    showAccount(part(root, "account"), scene, updated && updated[ACCOUNT]);
  }

  words(answer, truth) {
    const {codes, nodes, kidnapped} = this.scene, kind = codes[0][answer[KIND]];
    const named = answer[NODE] < 0 ? "named no node" : `named node ${nodeName(nodes, answer[NODE])}`;
    const verdict = answer[VERDICT] < 0 ? "" : ` (${codes[3][answer[VERDICT]]})`;
    const metres = Math.hypot(answer[X] - truth[0], answer[Y] - truth[1]) / 100;
    const turn = Math.abs(((answer[HEADING] - truth[2]) % 360 + 540) % 360 - 180);
    const notes = {gated: "; the gate stayed closed, the estimate rides on the odometry",
      blind: "; the frame was blind", unreadable: "; the picture could not be read"}[kind] || "";
    const carried = kidnapped.includes(this.step) ? "; the robot has just been carried here" : "";
    return `${named}${verdict} with probability ${fixed(answer[PROBABILITY] / 1000)}, ${codes[1][answer[STATUS]]}; ` +
      `${fixed(metres)} m and ${degrees(turn)} off${notes}${carried}`;
  }
}

if (part(document, "replay")) {
  const pictures = data(document, "pictures");
  for (const root of parts(document, "replay")) new Replay(root, pictures);
}
