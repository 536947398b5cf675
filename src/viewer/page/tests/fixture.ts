// A stand-in for the server where only the page is looked at: a dome that gives way under the hand like a spring.
import { createServer, type Server } from 'node:http';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize } from 'node:path';
import type { Page as Tab, WebSocketRoute } from 'playwright-core';
import { f32, frameBlock, message, pack, u16, u32, u8 } from './bytes';

const stiffness = 50; // N/m
const radius = 0.1; // m
const rings = 24;
const around = 48;

const types: Record<string, string> = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css' };

/** The built page at an address of its own. */
export function serveFiles(folder: string): Promise<{ server: Server; address: string }> {
  const server = createServer((request, response) => {
    const path = normalize((request.url ?? '/').split('?')[0] ?? '/');
    const file = join(folder, path === '/' ? 'index.html' : path);
    readFile(file).then(
      (data) => response.writeHead(200, { 'content-type': types[extname(file)] ?? 'application/octet-stream' }).end(data),
      () => response.writeHead(404).end(),
    );
  });
  return new Promise((resolve) => {
    server.listen(0, '127.0.0.1', () => {
      const address = server.address();
      resolve({ server, address: `http://127.0.0.1:${typeof address === 'object' ? address?.port : 0}/` });
    });
  });
}

function dome(): { rest: number[]; triangles: number[] } {
  const rest = [0, 0, radius];
  const triangles: number[] = [];
  for (let ring = 1; ring <= rings; ++ring) {
    for (let k = 0; k < around; ++k) {
      const polar = (0.5 * Math.PI * ring) / rings;
      const azimuth = (2 * Math.PI * k) / around;
      rest.push(
        radius * Math.sin(polar) * Math.cos(azimuth),
        radius * Math.sin(polar) * Math.sin(azimuth),
        radius * Math.cos(polar),
      );
      const here = 1 + (ring - 1) * around + k;
      const next = 1 + (ring - 1) * around + ((k + 1) % around);
      if (ring === 1) triangles.push(0, here, next);
      else triangles.push(here - around, here, next, here - around, next, next - around);
    }
  }
  return { rest, triangles };
}

/** What the page said, newest last. */
export interface Fixture {
  said: { type: string; [key: string]: unknown }[];
  socket: WebSocketRoute | null;
}

/** Answers the page's WebSocket in the tab. */
export async function attach(tab: Tab): Promise<Fixture> {
  const fixture: Fixture = { said: [], socket: null };
  const { rest, triangles } = dome();
  await tab.routeWebSocket(/\/ws$/, (socket) => {
    fixture.socket = socket;
    const say = (value: unknown): void => socket.send(JSON.stringify(value));
    let hand = [0, 0, 2 * radius];
    let pose = 0;
    let solve = 0;
    let credit = 0;
    let number = 1;
    const started = Date.now();
    const timer = setInterval(() => {
      if (credit <= 0) return;
      credit -= 1;
      solve += 1;
      const distance = Math.hypot(...hand);
      const depth = radius - distance;
      const force = Math.max(0, stiffness * depth);
      const axis = hand.map((x) => x / distance);
      const vertices: number[] = [];
      for (let v = 0; v < rest.length; v += 3) {
        const away = Math.hypot(...[0, 1, 2].map((d) => rest[v + d]! - radius * axis[d]!));
        const dent = Math.max(0, depth) * Math.exp(-((away / 0.03) ** 2));
        for (let d = 0; d < 3; ++d) vertices.push(rest[v + d]! - dent * axis[d]!);
      }
      const time = (Date.now() - started) / 1000;
      const block = frameBlock({
        time,
        tickTime: time,
        solve,
        vertices: rest.length / 3,
        pose: [pose, pose],
        state: depth > 0 ? 9 : 8,
        hand,
        tip: hand.map((x, d) => x + (depth > 0 ? 0.3 * depth * axis[d]! : 0)),
        force: axis.map((x) => force * x),
        rest: [...f32(0, 0, 0, 0, 0, 0, 0, 0, 1, depth, 0.005), ...u32(4, 300, 0), ...f32(1000, 90, 25, 2e-5), ...u32(1000, 1)],
      });
      number += 1;
      const sections = [{ kind: 16, data: pack(f32(...vertices)) }, { kind: 21, data: pack(f32(2e-3)) }];
      socket.send(Buffer.from(message(2, block, sections, { number, epoch: 1 })));
    }, 30);
    socket.onClose(() => clearInterval(timer));
    socket.onMessage((data) => {
      const request = JSON.parse(String(data)) as Fixture['said'][number];
      fixture.said.push(request);
      if (request.type === 'credit') credit += Number(request['frames']);
      if (request.type === 'take') say({ type: 'holder', id: 1 });
      if (request.type === 'mode') say({ type: 'mode', mode: request['mode'] });
      if (request.type === 'pose') {
        hand = request['position'] as number[];
        pose = Number(request['n']);
      }
      if (request.type !== 'hello') return;
      say({
        type: 'welcome',
        version: 1,
        id: 1,
        server: 'spherecut fixture',
        scenarios: [{ name: 'dome.toml', title: 'A dome' }],
        recordings: [],
        limits: { message_bytes: 65536, messages_per_second: 300, credit: 8, viewers: 16, speed: 0.5 },
      });
      say({
        type: 'session',
        epoch: 1,
        scenario: 'dome.toml',
        title: 'A dome',
        bounds: { lower: [-radius, -radius, 0], upper: [radius, radius, radius] },
        triangles: triangles.length / 3,
        nodes: 300,
        modes: ['probe', 'blade'],
        mode: 'probe',
        tool: { shape: 'sphere', radius: 0.005 },
        blade: { edge: [[0, 0, 0], [0.01, 0, 0.007], [0.022, 0, 0.024]] },
        park: { probe: [0, 0, 2 * radius], blade: [0, 0, 2 * radius] },
        spring: 300,
        settings: {
          young_modulus: 6000, poisson_ratio: 0.45, toughness: 0, method: 'galerkin', sight: 'enriched',
          fine_spacing: 0.006, coarse_spacing: 0.025,
        },
      });
      say({ type: 'holder', id: null });
      const vertexCount = rest.length / 3;
      const count = triangles.length / 3;
      const zeros = (n: number): number[] => new Array<number>(n).fill(0);
      socket.send(
        Buffer.from(
          message(1, pack(u32(1, vertexCount, count, 1)), [
            { kind: 1, data: pack(f32(...rest)) },
            { kind: 2, data: pack(u32(...triangles)) },
            { kind: 3, data: pack(u8(...zeros(vertexCount))) },
            { kind: 4, data: pack(u8(...zeros(count))) },
            { kind: 5, data: pack(u16(...zeros(count))) },
            { kind: 6, data: new Uint8Array(0) },
          ]),
        ),
      );
    });
  });
  return fixture;
}
