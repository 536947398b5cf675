// A picture kept with its depths, and put back: where the processor draws, what stands still is not drawn again for a tool that
// moves.

export class Still {
  private readonly framebuffer: WebGLFramebuffer;
  private readonly colour: WebGLRenderbuffer;
  private readonly depth: WebGLRenderbuffer;
  private width = 0; // px
  private height = 0;
  private fails = false;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.framebuffer = gl.createFramebuffer();
    this.colour = gl.createRenderbuffer();
    this.depth = gl.createRenderbuffer();
  }

  /** Whether a picture of the canvas's size is kept. */
  get kept(): boolean {
    return this.width === this.gl.drawingBufferWidth && this.height === this.gl.drawingBufferHeight;
  }

  /** Keeps the canvas; false: this browser cannot. */
  keep(): boolean {
    const { gl } = this;
    if (this.fails) return false;
    const first = this.width === 0;
    if (!this.kept) this.resize();
    this.copy(null, this.framebuffer);
    // Depths are copied between buffers of one format alone; of the canvas's it is not told.
    if (first) this.fails = gl.getError() !== gl.NO_ERROR;
    return !this.fails;
  }

  /** Puts it back. */
  show(): void {
    this.copy(this.framebuffer, null);
  }

  private copy(from: WebGLFramebuffer | null, to: WebGLFramebuffer | null): void {
    const { gl, width, height } = this;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null); // as three knows it
  }

  private resize(): void {
    const { gl } = this;
    this.width = gl.drawingBufferWidth;
    this.height = gl.drawingBufferHeight;
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.colour);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, this.width, this.height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH24_STENCIL8, this.width, this.height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, this.colour);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_STENCIL_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }
}
