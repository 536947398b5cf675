// A client that only reads: the feed of the server without a page and without a picture (RFC 6455, client side).
import { randomBytes } from 'node:crypto';
import { connect, type Socket } from 'node:net';
import { decodeBinary, protocolVersion } from '../source/protocol';

/** What came in a stretch of time. */
export interface Rates {
  seconds: number;
  frames: number; // a second
  vertices: number; // frames with new vertices, a second
  megabytes: number; // a second
  longest: number; // s, between two frames
}

export class Feed {
  private readonly socket: Socket;
  private bytes = Buffer.alloc(0);
  private parts: Buffer[] = []; // of a message in several
  private upgraded = false;
  private since = performance.now();
  private last = 0;
  private counted = { frames: 0, vertices: 0, bytes: 0, longest: 0 };

  /** `address` of the page. */
  constructor(address: string) {
    const { host, hostname, port } = new URL(address);
    this.socket = connect(Number(port), hostname);
    this.socket.setNoDelay(true);
    this.socket.write(
      `GET /ws HTTP/1.1\r\nHost: ${host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n` +
        `Sec-WebSocket-Key: ${randomBytes(16).toString('base64')}\r\nSec-WebSocket-Version: 13\r\n\r\n`,
    );
    this.socket.on('data', (data: Buffer) => this.receive(data));
  }

  /** What has come since the last call. */
  take(): Rates {
    const now = performance.now();
    const seconds = (now - this.since) / 1000;
    const { frames, vertices, bytes, longest } = this.counted;
    const idle = this.last > 0 ? Math.max(longest, (now - this.last) / 1000) : seconds;
    this.since = now;
    this.counted = { frames: 0, vertices: 0, bytes: 0, longest: 0 };
    return { seconds, frames: frames / seconds, vertices: vertices / seconds, megabytes: bytes / seconds / 1e6, longest: idle };
  }

  close(): void {
    this.socket.destroy();
  }

  private receive(data: Buffer): void {
    this.bytes = Buffer.concat([this.bytes, data]);
    if (!this.upgraded) {
      const end = this.bytes.indexOf('\r\n\r\n');
      if (end < 0) return;
      if (!this.bytes.subarray(0, end).includes(' 101 ')) throw new Error(this.bytes.subarray(0, end).toString());
      this.upgraded = true;
      this.bytes = this.bytes.subarray(end + 4);
      this.say({ type: 'hello', version: protocolVersion });
      this.say({ type: 'credit', frames: 2 });
    }
    for (let frame = this.next(); frame; frame = this.next()) this.takeIn(frame.code, frame.last, frame.data);
  }

  /** The next whole frame of the protocol. */
  private next(): { code: number; last: boolean; data: Buffer } | null {
    const { bytes } = this;
    if (bytes.length < 2) return null;
    let length = bytes[1]! & 127;
    let at = 2;
    if (length === 126) {
      if (bytes.length < 4) return null;
      length = bytes.readUInt16BE(2);
      at = 4;
    } else if (length === 127) {
      if (bytes.length < 10) return null;
      length = Number(bytes.readBigUInt64BE(2));
      at = 10;
    }
    if (bytes.length < at + length) return null;
    this.bytes = bytes.subarray(at + length);
    return { code: bytes[0]! & 15, last: (bytes[0]! & 128) !== 0, data: bytes.subarray(at, at + length) };
  }

  private takeIn(code: number, last: boolean, data: Buffer): void {
    if (code === 9) this.write(10, data); // a ping
    if (code > 2) return;
    this.parts.push(data);
    if (!last) return;
    const whole = Buffer.concat(this.parts);
    this.parts = [];
    if (whole[0] === 123) return; // text, JSON
    const message = decodeBinary(whole.buffer.slice(whole.byteOffset, whole.byteOffset + whole.length) as ArrayBuffer);
    this.counted.bytes += whole.length;
    if (message?.kind !== 'frame') return;
    const now = performance.now();
    if (this.last > 0) this.counted.longest = Math.max(this.counted.longest, (now - this.last) / 1000);
    this.last = now;
    this.counted.frames += 1;
    if (message.vertices) this.counted.vertices += 1;
    this.say({ type: 'credit', frames: 1 });
  }

  private say(message: object): void {
    this.write(1, Buffer.from(JSON.stringify(message)));
  }

  /** Masked, as clients must. */
  private write(code: number, data: Buffer): void {
    const mask = randomBytes(4);
    const head = data.length < 126 ? Buffer.from([128 | code, 128 | data.length]) : Buffer.from([128 | code, 254, data.length >> 8, data.length & 255]);
    this.socket.write(Buffer.concat([head, mask, data.map((byte, i) => byte ^ mask[i % 4]!)]));
  }
}
