import { drawnPixels } from './pixels';
import type { View } from './view';

/**
 * Saves what has just been drawn with `gl` over the drape as a PNG with a line of text below; `ratio`: its pixels per pixel of
 * the page.
 */
export function savePicture(gl: WebGL2RenderingContext, view: View, ratio: number, caption: string): void {
  const picture = drawnPixels(gl);
  const foot = Math.round(26 * ratio);
  const canvas = document.createElement('canvas');
  canvas.width = picture.width;
  canvas.height = picture.height + foot;
  const context = canvas.getContext('2d');
  if (!context) return;
  context.fillStyle = '#151c22';
  context.fillRect(0, 0, canvas.width, canvas.height);
  const drawn = document.createElement('canvas');
  [drawn.width, drawn.height] = [picture.width, picture.height];
  drawn.getContext('2d')?.putImageData(picture, 0, 0);
  view.drape.paint(context, view.orbit.camera, picture.width, picture.height);
  context.drawImage(drawn, 0, 0);
  context.fillStyle = '#dbe4ea';
  context.font = `${13 * ratio}px system-ui, 'DejaVu Sans', sans-serif`;
  context.textBaseline = 'middle';
  context.fillText(caption, 10 * ratio, canvas.height - 0.5 * foot);
  canvas.toBlob((blob) => {
    if (!blob) return;
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = `spherecut-${new Date().toISOString().replace(/[:.]/g, '-')}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }, 'image/png');
}
