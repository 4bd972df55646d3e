// A triangle of an image whose grey level changes evenly from corner to corner.

// Paint the corners a, b, c of a relief (places in relief.x, relief.y) in its shaded colours; a pixel belongs to the
// triangle that holds its centre, so that neighbours leave no gap.
export function paintTriangle(relief, levels, shade, a, b, c) {
  const { x, y, shaded, packed, width, height } = relief;
  let [top, middle, bottom] = [a, b, c];
  if (y[middle] < y[top]) [top, middle] = [middle, top];
  if (y[bottom] < y[top]) [top, bottom] = [bottom, top];
  if (y[bottom] < y[middle]) [middle, bottom] = [bottom, middle];
  const [topY, middleY, bottomY] = [y[top], y[middle], y[bottom]];
  const twice = (x[middle] - x[top]) * (bottomY - topY) - (x[bottom] - x[top]) * (middleY - topY);
  if (twice === 0) return; // seen from its edge
  const [up, down] = [levels[middle] - levels[top], levels[bottom] - levels[top]];
  const perX = (up * (bottomY - topY) - down * (middleY - topY)) / twice;
  const perY = (down * (x[middle] - x[top]) - up * (x[bottom] - x[top])) / twice;
  const last = Math.min(height - 1, Math.ceil(bottomY - 0.5) - 1);
  for (let line = Math.max(0, Math.ceil(topY - 0.5)); line <= last; line++) {
    const centre = line + 0.5;
    const long = x[top] + ((x[bottom] - x[top]) * (centre - topY)) / (bottomY - topY);
    const short =
      centre < middleY
        ? x[top] + ((x[middle] - x[top]) * (centre - topY)) / (middleY - topY)
        : x[middle] + ((x[bottom] - x[middle]) * (centre - middleY)) / (bottomY - middleY);
    const from = Math.max(0, Math.ceil(Math.min(long, short) - 0.5));
    const to = Math.min(width - 1, Math.ceil(Math.max(long, short) - 0.5) - 1);
    let level = levels[top] + (from + 0.5 - x[top]) * perX + (centre - topY) * perY;
    for (let at = line * width + from; at <= line * width + to; at++) {
      const whole = level < 0 ? 0 : level > 255 ? 255 : (level + 0.5) | 0;
      packed[at] = shaded[shade | whole];
      level += perX;
    }
  }
}
