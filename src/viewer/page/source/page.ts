import { advice, adviceOnLog, saying } from './advice';
import { forceColour, forceInWords, withUnit } from './colours';
import { ForceChart } from './chart';
import { Connection, type LinkState } from './connection';
import { element, write } from './element';
import { attachPointer } from './input';
import { bindings, gestures } from './bindings';
import { Hint } from './hint';
import { Keyboard } from './keys';
import { Latency } from './latency';
import { Messages } from './messages';
import type { Snapshot } from './body';
import { Panels, tearInWords } from './panels';
import type { Frame, Mode, Nodes, Scalars, ServerText, SessionStart, Slice, Support, Tear, Topology, Vec3, Welcome } from './protocol';
import { remember, remembered } from './remembered';
import { savePicture } from './screenshot';
import { castRay, type Hit } from './surface';
import type { Ray, Stylus } from './stylus';
import { Hands } from './hands';
import { nodeAlong } from './overlays';
import { type Shading, View } from './view';

const button = (id: string): HTMLButtonElement => element(id, HTMLButtonElement);
const byId = (id: string): HTMLElement => element(id, HTMLElement);

/** What the page knows, and how its parts hang together. */
export class Page {
  readonly view = new View(element('scene', HTMLCanvasElement));
  readonly latency = new Latency(); // to the picture of the body that was solved for the pose
  readonly toolLatency = new Latency(); // to the picture of the tool and its force that follow the pose
  pictures = 0; // drawn so far
  seenVertices = 0; // frames with new vertices so far
  session: SessionStart | null = null;
  frame: Frame | null = null;
  tear: Tear | null = null; // null: nothing tears here
  holder: number | null = null;
  id = -1;
  private readonly hint = new Hint();
  private readonly messages = new Messages(byId('messages'));
  private readonly chart = new ForceChart(element('chart', HTMLCanvasElement));
  private readonly panels: Panels;
  private readonly hands: Hands;
  private readonly keyboard: Keyboard;
  private readonly connection: Connection;
  private pending: Frame[] = [];
  private replayed: string | null = null; // name of the recording that is played
  private handsEpoch = -1; // of the session that the hands are in
  private tearEpoch = -1; // of the session that `tear` is of
  private taken = 0; // frames that the last picture shows
  private completed = true; // that picture is done
  private pointer = { x: -1, y: -1 }; // px, of the stylus
  private scalars: Scalars | null = null;
  nodes: Nodes | null = null; // that are shown
  support: Support | null = null; // of the picked one
  private slice: Slice | null = null;
  stages: Float32Array | null = null; // s, of the session so far
  private drawn: number[] = []; // times of the last pictures, ms
  private ratesShown = 0; // ms
  private chartShown = 0;
  private lastStep = performance.now();
  private wantsTool = true; // takes it when it is free

  constructor() {
    this.panels = new Panels({
      overlays: (request) => this.connection?.send({ type: 'overlays', ...request }),
      look: () => this.look(),
      set: (settings) => this.connection.send({ type: 'set', ...settings }),
      scenario: (name) => this.connection.send({ type: 'scenario', name }),
      mode: (mode) => this.chooseMode(mode),
    });
    this.hands = new Hands({
      cast: (ray, frozen) => this.cast(ray, frozen),
      snapshot: () => this.view.body.snapshot(),
      send: (message) => this.connection.send(message),
      posed: (n) => [this.latency, this.toolLatency].forEach((latency) => latency.posed(n, performance.now())),
      pressed: (pressing, keys) => this.showPress(pressing, keys),
    });
    this.keyboard = new Keyboard(bindings(this, this.hands, this.view.orbit, this.panels));
    this.keyboard.describe(byId('help-body'), gestures);
    attachPointer(this.view.canvas, this.view.orbit, this.hands, {
      ray: (x, y) => this.view.ray(x, y),
      pick: (ray) => this.pickAlong(ray),
      moved: (x, y) => (this.pointer = { x, y }),
      deepen: (by) => this.deepen(by, this.hands.mouse),
      changed: () => this.view.change(),
    });
    this.attachButtons();
    this.view.watchContext((lost) =>
      this.messages.say(lost ? 'warning' : 'info', lost ? 'The browser has taken the picture away; it is drawn again when the browser gives it back.' : 'The picture is back.'),
    );
    this.connection = new Connection(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws`, {
      onState: (state, reason) => this.linkChanged(state, reason),
      onText: (message) => this.read(message),
      onTopology: (topology) => this.newTopology(topology),
      onFrame: (frame) => this.arrived(frame),
    });
    setInterval(() => this.step(), 16);
    requestAnimationFrame(() => this.paint());
  }

  get holding(): boolean {
    return this.id >= 0 && this.holder === this.id;
  }

  // --- what the server says -------------------------------------------------------------------------------------------

  private read(message: ServerText): void {
    switch (message.type) {
      case 'welcome':
        return this.welcome(message);
      case 'session':
        return this.begin(message);
      case 'holder':
        this.holder = message.id;
        // Whoever comes to a free tool takes it; later it is taken by the button alone.
        if (this.wantsTool && message.id === null) this.connection.send({ type: 'take' });
        this.wantsTool = false;
        return this.showRole();
      case 'mode':
        this.hands.first.setMode(message.mode);
        this.view.trace.clear();
        this.panels.setMode(message.mode);
        return this.showDepth();
      case 'second':
        if (message.on !== this.hands.two) {
          this.hands.setTwo(message.on, this.holding);
          this.view.trace.clear();
        }
        return this.showHands();
      case 'building':
        byId('link').textContent = 'building';
        return this.messages.say('info', message.what);
      case 'error':
        if (message.about === 'mode') this.panels.setMode(this.hands.first.mode);
        if (message.about === 'scenario' && this.session) this.panels.scenario.value = this.session.scenario;
        return this.messages.say('error', saying(message.text, advice(message.code, message.about)));
      case 'log':
        // What the session does by itself is for who looks at its rates.
        if (message.level !== 'warning' && !this.panels.shown) return;
        return this.messages.say(message.level === 'warning' ? 'warning' : 'info', saying(message.text, adviceOnLog(message.text)));
      case 'tear':
        return this.showTear(message);
      case 'recording':
        button('record').setAttribute('aria-pressed', String(message.on));
        if (!message.on) this.panels.addRecording(message);
        byId('record-state').textContent =
          `${message.on ? 'Recording' : 'Recorded'} ${message.name}, ${message.seconds.toFixed(1)} s`;
        return this.showRole();
      case 'replay':
        button('replay').setAttribute('aria-pressed', String(message.on));
        this.replayed = message.on ? message.name : null;
        return this.showLive();
    }
  }

  private welcome(message: Welcome): void {
    this.id = message.id;
    this.handsEpoch = -1;
    this.wantsTool = true;
    this.panels.setScenarios(message.scenarios);
    for (const recording of message.recordings) this.panels.addRecording(recording);
    document.title = message.server;
  }

  private begin(session: SessionStart): void {
    const same = this.session?.scenario === session.scenario;
    this.session = session;
    this.latency.clear();
    this.toolLatency.clear();
    this.chart.clear();
    this.scalars = this.nodes = this.support = this.slice = this.stages = null;
    if (session.epoch !== this.tearEpoch) {
      this.tearEpoch = session.epoch;
      this.tear = null;
      this.panels.showTear(null);
    }
    this.showLive();
    this.view.setSession(session, same);
    // One that could not be replaced goes on, with the hands where they are.
    if (session.epoch !== this.handsEpoch) this.hands.setSession(session);
    this.handsEpoch = session.epoch;
    this.showHands();
    this.panels.setSession(session);
    this.showDepth();
    this.look();
    if (this.pointer.x < 0) this.centrePointer();
  }

  private showTear(tear: Tear): void {
    const before = this.tear;
    this.tear = tear;
    this.panels.showTear(tear);
    if (tear.state === before?.state || tear.state === 'none' || tear.state === 'intact') return;
    this.messages.say(tear.state === 'refused' ? 'warning' : 'info', tearInWords(tear));
  }

  private newTopology(topology: Topology): void {
    this.view.body.setTopology(topology);
    this.scalars = null;
    this.view.body.setScalars(null, 0, 1);
    this.view.change();
  }

  private linkChanged(state: LinkState, reason: string): void {
    const link = byId('link');
    link.dataset['state'] = state;
    link.textContent = { connecting: 'connecting', open: 'live', closed: 'not connected' }[state];
    this.replayed = null;
    if (state === 'open') return;
    this.holder = null;
    this.id = -1;
    this.pending = [];
    this.showRole();
    if (state === 'closed') this.messages.say('error', saying(`The connection to the server has ended${reason ? `: ${reason}` : ''}`, 'The page comes back by itself; if not, start spherecut serve again.'));
  }

  private showLive(): void {
    const link = byId('link');
    link.dataset['state'] = this.replayed === null ? 'open' : 'replay';
    link.textContent = this.replayed === null ? 'live' : `replay of ${this.replayed}`;
  }

  private showRole(): void {
    this.hands.holding = this.holding;
    this.panels.setHolding(this.holding);
    byId('role').textContent =
      this.id < 0 ? '' : this.holding ? 'you hold the tool' : this.holder === null ? 'nobody holds the tool' : `watching: viewer ${this.holder} holds the tool`;
    const take = button('take');
    take.hidden = this.id < 0;
    take.textContent = this.holding ? 'Let go' : 'Take the tool';
    take.disabled = !this.holding && this.holder !== null;
    for (const id of ['reset', 'record', 'press-hold', 'two-hands']) button(id).disabled = !this.holding;
    button('replay').disabled = !this.holding || this.panels.recording === null;
    button('download').disabled = this.panels.recording === null;
  }

  // --- the picture ----------------------------------------------------------------------------------------------------

  private paint(): void {
    requestAnimationFrame(() => this.paint());
    this.show();
  }

  /** Where the processor draws, a picture takes longer than the screen: it begins at once. */
  private arrived(frame: Frame): void {
    this.pending.push(frame);
    if (this.view.software && !document.hidden) this.show();
  }

  private show(): void {
    if (!this.complete() || this.view.resting) return;
    const frames = this.pending;
    this.pending = [];
    // Of several only the newest vertices are seen.
    const seen = frames.map((frame) => frame.vertices !== null).lastIndexOf(true);
    frames.forEach((frame, i) => this.take(frame, i === seen));
    this.taken = frames.length;
    this.completed = !this.view.draw() && frames.length === 0;
    if (frames.length > 0) this.showNumbers(performance.now());
    this.watch();
  }

  private watch(): void {
    if (!this.complete()) setTimeout(() => this.watch(), 2);
  }

  /** Whether the last picture is done: it counts then, not when it is ordered, and gives back the credit of what it shows. */
  private complete(): boolean {
    if (this.completed) return true;
    if (this.view.busy()) return false;
    this.completed = true;
    const now = performance.now();
    this.pictures += 1;
    this.drawn.push(now);
    while ((this.drawn[0] ?? now) < now - 1000) this.drawn.shift();
    if (this.frame) {
      this.latency.drawn(this.frame.poseInSolve, now);
      this.toolLatency.drawn(this.frame.poseInTick, now);
    }
    if (this.taken > 0) this.connection.shown(this.taken, this.view.pictureSeconds);
    return true;
  }

  private take(frame: Frame, moves: boolean): void {
    const body = this.view.body;
    if (frame.epoch !== this.session?.epoch || frame.topology !== body.topology?.topology) return;
    this.frame = frame;
    this.hands.answered(frame);
    if (frame.vertices) this.seenVertices += 1;
    const bodyMoved = frame.vertices !== null && moves && body.setVertices(frame.vertices);
    // What has been switched off since this was asked for stays away.
    const { colours, supports, slice } = this.panels;
    if (frame.vertices || frame.scalars) this.scalars = colours.value === 'none' ? null : frame.scalars;
    this.nodes = frame.nodes ?? this.nodes;
    if (supports.checked) this.support = frame.support ?? this.support;
    if (slice.value !== 'none') this.slice = frame.slice ?? this.slice;
    this.stages = frame.stages ?? this.stages;
    if (frame.scalars) this.colour();
    if (frame.nodes || frame.support) this.showNodes();
    if (frame.slice) this.showSlice();
    this.view.follow(frame, this.session.blade?.edge ?? []);
    this.chart.add(frame.tickTime, Math.hypot(...frame.force));
    this.panels.showFrame(frame);
    if (bodyMoved || frame.scalars || frame.nodes || frame.support || frame.slice) this.view.change();
    else this.view.moved();
  }

  private showNumbers(now: number): void {
    const frame = this.frame;
    if (!frame) return;
    const force = byId('force');
    write(force, forceInWords(Math.hypot(...frame.force)));
    force.style.color = forceColour(Math.hypot(...frame.force));
    write(byId('torque'), withUnit(Math.hypot(...frame.torque), 'N m'));
    write(byId('depth'), `${(1000 * Math.max(frame.depth, 0)).toFixed(1)} mm`);
    const lag = Math.hypot(...frame.hand.map((x, d) => x - (frame.tip[d] ?? x)));
    write(byId('lag'), `${(1000 * lag).toFixed(1)} mm`);
    byId('second-readout').hidden = !frame.second;
    if (frame.second) {
      const newtons = Math.hypot(...frame.second.force);
      write(byId('second-force'), forceInWords(newtons));
      byId('second-force').style.color = forceColour(newtons);
    }
    // What the processor draws beside the picture it does not draw for the picture.
    if (now - this.chartShown > (this.view.software ? 125 : 0)) {
      this.chartShown = now;
      this.chart.draw(frame.tickTime);
    }
    if (now - this.ratesShown < 250) return;
    this.ratesShown = now;
    this.panels.showRates(frame, this.drawn.length, this.toolLatency, this.latency, this.stages);
  }

  /** Applies what the switches ask for to what is known. */
  private look(): void {
    if (this.panels.colours.value === 'none') this.scalars = null;
    const inside = this.panels.nodes.checked || this.panels.spheres.checked || this.panels.supports.checked;
    this.view.body.setLook(inside || this.panels.slice.value !== 'none', this.panels.wire.checked);
    this.view.tool.showSpring = this.view.second.showSpring = this.panels.spring.checked;
    this.view.showPlan = this.panels.plan.checked;
    this.view.shading = this.panels.shading.value as Shading;
    if (this.frame) this.view.showTools(this.frame);
    if (!this.panels.supports.checked) this.support = null;
    if (this.panels.slice.value === 'none') this.slice = null;
    this.colour();
    this.showNodes();
    this.showSlice();
    this.view.change();
  }

  private colour(): void {
    const scalars = this.scalars;
    this.view.body.setScalars(scalars, scalars?.low ?? 0, scalars?.high ?? 1);
    if (scalars) {
      const unit = scalars.quantity === 'displacement' ? 'm' : 'Pa';
      const name = scalars.quantity === 'displacement' ? 'displacement' : 'von Mises stress';
      this.panels.showScale(name, withUnit(scalars.low, unit), withUnit(scalars.high, unit), false);
    } else if (!this.slice) byId('scale').hidden = true;
  }

  private showNodes(): void {
    const { nodes, spheres, supports } = this.panels;
    this.view.overlays.setNodes(this.nodes, this.support, nodes.checked || supports.checked, spheres.checked);
  }

  private showSlice(): void {
    const shows = this.panels.sliceShows;
    const ends = this.view.overlays.setSlice(this.slice, shows);
    if (!ends) {
      if (!this.scalars) byId('scale').hidden = true;
      return;
    }
    if (shows === 'organ') this.panels.showScale('distance to the surface', withUnit(ends[0], 'm'), withUnit(ends[1], 'm'), true);
    else this.panels.showScale('distance to the cut', withUnit(ends[1], 'm'), withUnit(0, 'm'), false);
  }

  // --- the hand -------------------------------------------------------------------------------------------------------

  private step(): void {
    const now = performance.now();
    // A picture that takes long holds this up; the hand and keys that are held go on by what was missed.
    const seconds = Math.min((now - this.lastStep) / 1000, 0.3);
    this.lastStep = now;
    if (this.keyboard.advance(seconds)) this.view.change();
    this.hands.advance(seconds);
  }

  private cast(ray: Ray, frozen: Snapshot | null): Hit | null {
    const hit = frozen
      ? castRay(frozen.positions, frozen.triangles, frozen.normals, ray.origin, ray.direction)
      : this.view.body.cast(ray.origin, ray.direction);
    this.view.setMark(this.holding && !frozen ? hit : null);
    return hit;
  }

  private centrePointer(): void {
    const { clientWidth, clientHeight } = this.view.canvas;
    this.pointer = { x: 0.5 * clientWidth, y: 0.45 * clientHeight };
  }

  movePointer(dx: number, dy: number): void {
    const { clientWidth, clientHeight } = this.view.canvas;
    if (this.pointer.x < 0) this.centrePointer();
    const { hands } = this;
    const from = hands.two ? hands.keysFrom(() => this.view.pixel(this.placeOfKeys()), performance.now()) : this.pointer;
    const x = Math.min(Math.max(from.x + dx, 0), clientWidth);
    const y = Math.min(Math.max(from.y + dy, 0), clientHeight);
    // With two hands the keys find the organ from wherever their tool is, also past places beside it.
    if (hands.keys.point(this.view.ray(x, y)) || hands.two) Object.assign(from, { x, y });
  }

  togglePress(): void {
    const { keys } = this.hands;
    if (keys.pressing) return keys.release();
    this.movePointer(0, 0);
    keys.press();
  }

  /** The place of the surface that the keys' tool is over, m; of one that is away its tip. */
  private placeOfKeys(): Vec3 {
    const { frame, hands } = this;
    return hands.keys.over ?? (hands.keys === hands.first ? frame?.tip : frame?.second?.tip) ?? [0, 0, 0];
  }

  /** The blade goes into the other hand, beside the tool in the first, or is laid away. */
  toggleTwoHands(): void {
    if (this.session?.two_hands) this.connection.send({ type: 'second', on: !this.hands.two });
    else this.messages.say('warning', 'Two hands need a tool and a blade: this scenario has not both.');
  }

  swapHands(): void {
    this.hands.swap();
    this.showHands();
  }

  /** Whose force is which, and what leads whom. */
  private showHands(): void {
    const { two, mouse, first } = this.hands;
    const toggle = button('two-hands');
    toggle.hidden = !this.session?.two_hands;
    toggle.setAttribute('aria-pressed', String(two));
    byId('hands').hidden = !two;
    const tool = first.mode;
    write(byId('hands'), mouse === first ? `mouse: ${tool}, keys: blade (6: change)` : `mouse: blade, keys: ${tool} (6: change)`);
    this.showPress(this.hands.keys.pressing, true);
    this.showDepth();
  }

  private showPress(pressing: boolean, keys: boolean): void {
    if (keys) button('press-hold').setAttribute('aria-pressed', String(pressing));
    if (pressing) {
      this.view.setMark(null);
      this.hint.close();
    }
  }

  chooseMode(mode: Mode): void {
    if (this.session?.modes.includes(mode)) this.connection.send({ type: 'mode', mode });
    else this.messages.say('warning', `This scenario has no ${mode}.`);
  }

  deepen(by: number, stylus: Stylus): void {
    stylus.deepen(by);
    this.showDepth();
  }

  private showDepth(): void {
    const slider = element('press-depth', HTMLInputElement);
    const { keys } = this.hands;
    const depth = 1000 * keys.depths[keys.mode];
    slider.min = keys.mode === 'grasper' ? '-20' : '0';
    slider.value = String(depth);
    byId('press-depth-value').textContent = `${depth.toFixed(1)} mm`;
  }

  /** In picking, the node under the ray that is nearest to the eye; false: clicks are not for picking. */
  private pickAlong(ray: Ray): boolean {
    const nodes = this.nodes;
    if (!this.panels.supports.checked || !nodes) return false;
    const best = nodeAlong(nodes, ray);
    if (best < 0) return false;
    this.panels.pick(best);
    return true;
  }

  // --- buttons and keys -----------------------------------------------------------------------------------------------

  private attachButtons(): void {
    button('take').addEventListener('click', () => this.toggleTool());
    button('reset').addEventListener('click', () => this.reset());
    button('home').addEventListener('click', () => this.home());
    button('help-open').addEventListener('click', () => this.help());
    button('panels-toggle').addEventListener('click', () => this.togglePanels());
    button('record').addEventListener('click', () => this.record());
    button('replay').addEventListener('click', () => this.replay());
    button('download').addEventListener('click', () => this.download());
    button('screenshot').addEventListener('click', () => this.screenshot());
    button('two-hands').addEventListener('click', () => this.toggleTwoHands());
    button('press-hold').addEventListener('click', () => this.togglePress());
    element('press-depth', HTMLInputElement).addEventListener('input', (event) => {
      this.hands.keys.setDepth(Number((event.target as HTMLInputElement).value) / 1000);
      this.showDepth();
    });
    // Folded at first: the picture is what one comes for.
    this.panels.show(remembered('panels') === 'yes');
    this.showDepth();
    this.showRole();
  }

  reset(): void {
    this.hands.release();
    this.connection.send({ type: 'reset' });
  }

  toggleTool(): void {
    if (!button('take').disabled) this.connection.send({ type: this.holding ? 'release' : 'take' });
  }

  pickAtTip(): void {
    if (this.frame) this.panels.pick(this.frame.tip);
  }

  help(): void {
    element('help', HTMLDialogElement).showModal();
  }

  park(): void {
    this.hands.keys.putAway();
  }

  home(): void {
    this.view.orbit.home();
    this.view.change();
  }

  record(): void {
    this.connection.send({ type: 'record', on: button('record').getAttribute('aria-pressed') !== 'true' });
  }

  replay(): void {
    const running = button('replay').getAttribute('aria-pressed') === 'true';
    const name = this.panels.recording?.name ?? null;
    if (running || name !== null) this.connection.send({ type: 'replay', name: running ? null : name });
  }

  download(): void {
    const recording = this.panels.recording;
    if (!recording) return;
    const link = document.createElement('a');
    link.href = recording.url;
    link.download = recording.name;
    link.click();
  }

  screenshot(): void {
    this.view.drawWhole();
    const { frame, session } = this;
    const force = frame ? `${forceInWords(Math.hypot(...frame.force))}, ` : '';
    const { canvas } = this.view;
    const gl = canvas.getContext('webgl2');
    if (!gl) return;
    savePicture(gl, this.view, canvas.width / Math.max(canvas.clientWidth, 1), `Spherecut · ${session?.title ?? ''} · ${force}${(frame?.time ?? 0).toFixed(2)} s`);
  }

  togglePanels(): void {
    const shown = !this.panels.shown;
    this.panels.show(shown);
    remember('panels', shown ? 'yes' : 'no');
    this.ratesShown = 0;
    this.showNumbers(performance.now());
  }
}
