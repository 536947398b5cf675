// The panels beside the picture: what they show, and what they ask for.
import { diverging, drawBar, sequential, withUnit } from './colours';
import { element, write } from './element';
import type { Latency } from './latency';
import {
  type Colour,
  type Frame,
  type Mode,
  modes,
  type Overlays,
  type Recording,
  type SessionStart,
  type Settings,
  type SliceRequest,
  stageNames,
  State,
  type Tear,
  type Vec3,
} from './protocol';
import type { SliceShows } from './overlays';

export interface PanelHost {
  overlays(request: Overlays): void;
  look(): void;
  set(settings: Partial<Settings>): void;
  scenario(name: string): void;
  mode(mode: Mode): void;
}

const check = (id: string): HTMLInputElement => element(id, HTMLInputElement);
const select = (id: string): HTMLSelectElement => element(id, HTMLSelectElement);

export class Panels {
  readonly nodes = check('show-nodes');
  readonly spheres = check('show-spheres');
  readonly supports = check('show-supports');
  readonly wire = check('show-wire');
  readonly plan = check('show-plan');
  readonly spring = check('show-spring');
  readonly colours = select('colours');
  readonly shading = select('shading');
  readonly slice = select('slice');
  readonly sliceAxis = select('slice-axis');
  readonly slicePlace = check('slice-place');
  readonly scenario = select('scenario');
  readonly recordings = select('recordings');
  private readonly list: Recording[] = [];
  private picked: number | Vec3 | null = null;
  private session: SessionStart | null = null;
  private volumes: string[] = []; // cm3, as shown

  constructor(private readonly host: PanelHost) {
    const ask = (): void => this.askOverlays();
    for (const input of [this.nodes, this.spheres, this.supports, this.colours, this.slice, this.sliceAxis]) {
      input.addEventListener('change', ask);
    }
    this.slicePlace.addEventListener('input', ask);
    for (const input of [this.wire, this.spring, this.plan, this.shading]) input.addEventListener('change', () => host.look());
    this.scenario.addEventListener('change', () => host.scenario(this.scenario.value));
    element('modes', HTMLFieldSetElement).addEventListener('change', (event) => {
      if (event.target instanceof HTMLInputElement) host.mode(event.target.value as Mode);
    });
    for (const id of ['material', 'method-form']) {
      element(id, HTMLFormElement).addEventListener('submit', (event) => {
        event.preventDefault();
        this.apply();
      });
    }
  }

  get shown(): boolean {
    return element('panels', HTMLElement).dataset['shown'] === 'yes';
  }

  show(shown: boolean): void {
    element('panels', HTMLElement).dataset['shown'] = shown ? 'yes' : 'no';
    element('panels-toggle', HTMLButtonElement).setAttribute('aria-expanded', String(shown));
  }

  get sliceShows(): SliceShows {
    return this.slice.value === 'cut' ? 'cut' : 'organ';
  }

  setScenarios(scenarios: readonly { name: string; title: string }[]): void {
    this.scenario.replaceChildren(...scenarios.map(({ name, title }) => new Option(title || name, name)));
  }

  setSession(session: SessionStart): void {
    this.session = session;
    if (![...this.scenario.options].some((option) => option.value === session.scenario)) {
      this.scenario.add(new Option(session.title || session.scenario, session.scenario));
    }
    this.scenario.value = session.scenario;
    this.picked = null;
    const { settings } = session;
    check('young').value = neat(settings.young_modulus / 1000);
    check('poisson').value = neat(settings.poisson_ratio);
    check('toughness').value = neat(settings.toughness);
    check('fine').value = neat(settings.fine_spacing * 1000);
    check('coarse').value = neat(settings.coarse_spacing * 1000);
    select('method').value = settings.method;
    select('support-rule').value = settings.sight;
    for (const mode of modes) {
      const input = this.modeInput(mode);
      input.disabled = !session.modes.includes(mode);
      input.parentElement?.setAttribute('title', input.disabled ? `This scenario has no ${mode}.` : '');
    }
    this.setMode(session.mode);
    this.askOverlays();
  }

  setMode(mode: Mode): void {
    this.modeInput(mode).checked = true;
  }

  /** Greyed where another client holds the tool. */
  setHolding(holding: boolean): void {
    for (const id of ['young', 'poisson', 'toughness', 'fine', 'coarse', 'method', 'support-rule']) {
      const input = document.getElementById(id);
      if (input instanceof HTMLInputElement || input instanceof HTMLSelectElement) input.disabled = !holding;
    }
    for (const form of ['material', 'method-form']) {
      for (const button of element(form, HTMLFormElement).querySelectorAll('button')) button.disabled = !holding;
    }
    this.scenario.disabled = !holding;
  }

  addRecording(recording: Recording): void {
    const known = this.list.findIndex(({ name }) => name === recording.name);
    if (known >= 0) this.list[known] = recording;
    else this.list.push(recording);
    this.recordings.replaceChildren(
      ...this.list.map(({ name, bytes }) => new Option(`${name} (${withUnit(bytes, 'B')})`, name)),
    );
    this.recordings.value = recording.name;
    this.recordings.disabled = false;
  }

  /** The recording chosen in the list; null: there is none. */
  get recording(): Recording | null {
    return this.list.find(({ name }) => name === this.recordings.value) ?? null;
  }

  /** Asks for the supports of a node, by number or by the place nearest to which it is. */
  pick(node: number | Vec3): void {
    this.picked = node;
    this.supports.checked = true;
    this.askOverlays();
  }

  askOverlays(): void {
    if (!this.supports.checked) this.picked = null;
    this.host.overlays({
      colour: this.colours.value as Colour,
      nodes: this.nodes.checked || this.spheres.checked || this.supports.checked,
      pick: this.picked,
      slice: this.sliceRequest(),
      stages: true,
    });
    this.host.look();
  }

  showFrame(frame: Frame): void {
    if (frame.support) {
      const { node, radius, seen, hidden } = frame.support;
      element('support-state', HTMLElement).textContent =
        `Node ${node}, support ${withUnit(radius, 'm')}: sees ${seen.length} nodes, ${hidden.length} hidden by the cut.`;
    }
    const volumes = frame.volumes ? [...frame.volumes].map((volume) => (volume * 1e6).toPrecision(4)) : this.volumes;
    if (volumes.join() !== this.volumes.join()) {
      this.volumes = volumes;
      element('pieces', HTMLTableSectionElement).replaceChildren(...volumes.map((volume, i) => line(String(i + 1), volume)));
    }
    write(
      element('cut-state', HTMLElement),
      frame.cutArea > 0
        ? `Cut ${(frame.cutArea * 1e4).toPrecision(3)} cm², front ${withUnit(frame.frontLength, 'm')}, opens by ${withUnit(frame.opening, 'm')}.`
        : 'No cut yet.',
    );
  }

  /** What the tears are at; null: nothing tears in this session. */
  showTear(tear: Tear | null): void {
    const line = element('tear-state', HTMLElement);
    line.hidden = tear === null || tear.state === 'none';
    line.dataset['state'] = tear?.state ?? 'none';
    if (tear) write(line, tearInWords(tear));
  }

  /** What colours stand for; `signed`: zero is in the middle. */
  showScale(name: string, low: string, high: string, signed: boolean): void {
    element('scale', HTMLElement).hidden = false;
    element('scale-name', HTMLElement).textContent = name;
    element('scale-low', HTMLElement).textContent = low;
    element('scale-high', HTMLElement).textContent = high;
    drawBar(element('scale-bar', HTMLCanvasElement), signed ? diverging : sequential);
  }

  showRates(frame: Frame, display: number, tool: Latency, body: Latency, stages: Float32Array | null): void {
    write(
      element('rate-line', HTMLElement),
      `${frame.hapticRate.toFixed(0)} Hz felt, ${frame.solveRate.toFixed(0)} Hz solved, ${display.toFixed(0)} Hz drawn`,
    );
    if (!this.shown) return;
    const share = frame.ticks > 0 ? ` (${((100 * frame.misses) / frame.ticks).toFixed(2)} %)` : '';
    const p95 = (latency: Latency): string => {
      const seconds = latency.quantile(0.95);
      return seconds === null ? '-' : withUnit(seconds, 's');
    };
    const rows = [
      line('Haptic loop', `${frame.hapticRate.toFixed(0)} Hz${frame.state & State.realtime ? '' : ', no FIFO'}`),
      line('Deadline misses', `${frame.misses}${share}`, frame.misses > 0.01 * frame.ticks),
      line('Tick', `${withUnit(frame.tickSeconds, 's')}, wakes within ${withUnit(frame.worstWake, 's')}`),
      line('Solve', `${frame.solveRate.toFixed(1)} Hz, ${withUnit(frame.solveSeconds, 's')}`),
      line('Frames', `${frame.pictureRate.toFixed(1)} Hz sent, ${display.toFixed(0)} Hz drawn`),
      line('Hand to picture, p95', `tool ${p95(tool)}, body ${p95(body)}`),
      line('Nodes', `${frame.nodeCount}, ${frame.active} in contact`),
      line('Coarsening', `level ${frame.level}`, frame.level > 0),
    ];
    if (stages) {
      const whole = stages.reduce((sum, seconds) => sum + seconds, 0);
      stageNames.forEach((name, i) => {
        const seconds = stages[i] ?? 0;
        rows.push(line(`· ${name}`, `${withUnit(seconds, 's')}, ${whole > 0 ? ((100 * seconds) / whole).toFixed(0) : 0} %`));
      });
    }
    element('rates', HTMLTableSectionElement).replaceChildren(...rows);
  }

  private sliceRequest(): SliceRequest | null {
    if (this.slice.value === 'none' || !this.session) return null;
    const { lower, upper } = this.session.bounds;
    const axis = Number(this.sliceAxis.value);
    const point = lower.map((low, d) => 0.5 * (low + (upper[d] ?? low))) as Vec3;
    const low = lower[axis] ?? 0;
    point[axis] = low + Number(this.slicePlace.value) * ((upper[axis] ?? low) - low);
    const normal: Vec3 = [0, 0, 0];
    normal[axis] = 1;
    const size = 1.1 * Math.max(...lower.map((from, d) => (upper[d] ?? from) - from));
    return { point, normal, size, count: 96 };
  }

  private apply(): void {
    const before = this.session?.settings;
    if (!before) return;
    const wanted: Settings = {
      young_modulus: 1000 * check('young').valueAsNumber,
      poisson_ratio: check('poisson').valueAsNumber,
      toughness: check('toughness').valueAsNumber,
      fine_spacing: check('fine').valueAsNumber / 1000,
      coarse_spacing: check('coarse').valueAsNumber / 1000,
      method: select('method').value,
      sight: select('support-rule').value,
    };
    const changed = Object.entries(wanted).filter(([key, value]) => {
      const old = before[key as keyof Settings];
      if (typeof value !== 'number' || typeof old !== 'number') return value !== old;
      return Number.isFinite(value) && Math.abs(value - old) > 1e-6 * Math.abs(old);
    });
    if (changed.length > 0) this.host.set(Object.fromEntries(changed));
  }

  private modeInput(mode: Mode): HTMLInputElement {
    const input = document.querySelector(`input[name=mode][value=${mode}]`);
    if (!(input instanceof HTMLInputElement)) throw new Error(`the document has no mode '${mode}'`);
    return input;
  }
}

/** What the tears are at, and why they go no further. */
export function tearInWords({ state, text, area }: Tear): string {
  const torn = `${(area * 1e4).toPrecision(3)} cm²`;
  switch (state) {
    case 'none':
      return '';
    case 'intact':
      return `No tear: ${text}.`;
    case 'growing':
      return `Tearing, ${torn} so far.`;
    case 'unstable':
      return `The tear is unstable, it runs on by itself: ${torn} so far.`;
    case 'arrested':
      return `The tear is arrested at ${torn}: ${text}.`;
    case 'refused':
      return `The tear has stopped at ${torn}, its front was refused: ${text}.`;
    case 'severed':
      return `The tear has parted the organ: ${torn}.`;
  }
}

function line(name: string, value: string, bad = false): HTMLTableRowElement {
  const row = document.createElement('tr');
  const head = row.insertCell();
  head.textContent = name;
  const cell = row.insertCell();
  cell.textContent = value;
  if (bad) cell.className = 'miss';
  return row;
}

/** Six digits at most, for a field. */
function neat(value: number): string {
  return String(Number(value.toPrecision(6)));
}
