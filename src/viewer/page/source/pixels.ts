/**
 * What has just been drawn with `gl`, from the upper left corner on. Read and not copied from its canvas: when the browser's
 * process that draws has died and another one goes on, copies of the canvas can stay black for good. Black while there is none.
 * Colours are those of the screen times their alpha; an image has them without it.
 */
export function drawnPixels(gl: WebGL2RenderingContext): ImageData {
  const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const picture = new ImageData(width, height);
  const bytes = new Uint8Array(4 * width * height); // from the lower left corner on
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const row = 4 * width;
  for (let y = 0; y < height; ++y) picture.data.set(bytes.subarray(y * row, (y + 1) * row), (height - 1 - y) * row);
  const { data } = picture;
  for (let i = 3; i < data.length; i += 4) {
    const alpha = data[i]!;
    if (alpha === 255 || alpha <= 1) continue;
    for (let k = i - 3; k < i; ++k) data[k] = (255 * data[k]!) / alpha;
  }
  return picture;
}
