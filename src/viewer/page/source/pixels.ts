/**
 * What has just been drawn with `gl`, from the upper left corner on. Read and not copied from its canvas: when the browser's
 * process that draws has died and another one goes on, copies of the canvas can stay black for good. Black while there is none.
 */
export function drawnPixels(gl: WebGL2RenderingContext): ImageData {
  const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const picture = new ImageData(width, height);
  const bytes = new Uint8Array(4 * width * height); // from the lower left corner on
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const row = 4 * width;
  for (let y = 0; y < height; ++y) picture.data.set(bytes.subarray(y * row, (y + 1) * row), (height - 1 - y) * row);
  return picture;
}
