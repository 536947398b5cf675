// The WebSocket: hello, credit, and coming back when the server went away.
import { ClientText, decodeBinary, decodeText, Frame, ProtocolError, protocolVersion, ServerText, Topology } from './protocol';

export type LinkState = 'connecting' | 'open' | 'closed';

export interface Listener {
  onState(state: LinkState, reason: string): void;
  onText(message: ServerText): void;
  onTopology(topology: Topology): void;
  onFrame(frame: Frame): void;
}

/** Frames that may be on their way at a time; where pictures are slow one, or it waits for the picture before. */
const credit = 2;
const slowPicture = 0.025; // s

export class Connection {
  private socket: WebSocket | null = null;
  private wait = 500; // ms until the next attempt
  private heldBack = false; // one of the credit

  constructor(
    private readonly address: string,
    private readonly listener: Listener,
  ) {
    this.open();
  }

  get ready(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  send(message: ClientText): void {
    if (this.ready) this.socket?.send(JSON.stringify(message));
  }

  /** Gives back the credit of frames that have been shown, the last of them in a picture that took `seconds`. */
  shown(frames: number, seconds: number): void {
    const slow = seconds > slowPicture;
    if (slow && !this.heldBack) frames -= 1;
    if (!slow && this.heldBack) frames += 1;
    this.heldBack = slow;
    if (frames > 0) this.send({ type: 'credit', frames });
  }

  private open(): void {
    this.listener.onState('connecting', '');
    const socket = new WebSocket(this.address);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    let fault = '';
    socket.onopen = () => {
      this.send({ type: 'hello', version: protocolVersion });
      this.heldBack = false;
      this.send({ type: 'credit', frames: credit });
      this.listener.onState('open', '');
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      try {
        this.receive(event.data);
        this.wait = 500;
      } catch (error) {
        if (!(error instanceof ProtocolError)) throw error;
        fault = `The server sent what this page cannot read: ${error.message}.`;
        socket.close(4000, error.message.slice(0, 120));
      }
    };
    socket.onclose = (event: CloseEvent) => {
      this.listener.onState('closed', fault || event.reason);
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, 5000);
    };
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data === 'string') {
      const message = decodeText(data);
      if (message) this.listener.onText(message);
      return;
    }
    const message = decodeBinary(data);
    if (message?.kind === 'topology') this.listener.onTopology(message);
    if (message?.kind === 'frame') this.listener.onFrame(message);
  }
}
