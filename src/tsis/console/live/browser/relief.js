// A picture as a relief: a mesh of block means in parallel projection, painted from the back to the front.
//
// Over a grid the order of rows and columns hides what is hidden, so that no depth is kept. Levels are interpolated
// inside a triangle, and its slope gives the shade.

import { paintTriangle } from "./triangle.js";

const TALL = 0.42; // full height over the picture's width
const SHADES = 32;
const DIMMEST = 0.4;
const LIGHT = [-0.45, -0.35, 0.82]; // from the left and from behind, above
const BACK = 0.3; // of the height: what a relief rises to at its farthest corner
const ROOM = 4; // lines of text around the surface, for its axes
const LEVEL = 255;

// Means of square blocks, about so many across.
export function blockMeans(frame, across) {
  const side = Math.max(1, Math.floor(frame.columns / across));
  const columns = Math.floor(frame.columns / side);
  const rows = Math.floor(frame.rows / side);
  const levels = new Float32Array(rows * columns);
  for (let y = 0; y < rows * side; y++) {
    const base = Math.floor(y / side) * columns;
    let at = y * frame.columns;
    for (let column = 0; column < columns; column++) {
      let sum = 0;
      for (const end = at + side; at < end; at++) sum += frame.pixels[at];
      levels[base + column] += sum;
    }
  }
  for (let at = 0; at < levels.length; at++) levels[at] /= side * side;
  return { levels, rows, columns };
}

// Height of the axes' text in an image of that width.
export const textSize = (width) => Math.max(10, width / 44);

// Where points of the box stand in an image of width x height; u, v, h in [0, 1] along columns, rows and upwards.
export class View {
  constructor({ width, height, azimuth, elevation, aspect }) {
    [this.cos, this.sin] = [Math.cos(azimuth), Math.sin(azimuth)];
    [this.flat, this.steep] = [Math.sin(elevation), Math.cos(elevation)];
    this.aspect = aspect;
    const wide = Math.abs(this.cos) + aspect * Math.abs(this.sin);
    const deep = Math.abs(this.sin) + aspect * Math.abs(this.cos);
    const room = ROOM * textSize(width);
    const below = (deep * this.flat) / 2; // of the middle of the floor
    const left = this.near(this.cos >= 0 ? 0 : 1, this.sin >= 0 ? 1 : 0); // where the axis of height stands
    const tall = TALL * this.steep;
    const above = Math.max(below + BACK * tall, tall + Math.max(0, -left) * this.flat);
    this.scale = Math.min((width - 2 * room) / wide, (height - 1.3 * room) / (above + below));
    [this.x, this.y] = [width / 2, (height - 0.5 * room + this.scale * (above - below)) / 2];
  }

  // Distance towards the viewer.
  near(u, v) {
    return (u - 0.5) * this.sin + (v - 0.5) * this.aspect * this.cos;
  }

  across(u, v) {
    return this.x + this.scale * ((u - 0.5) * this.cos - (v - 0.5) * this.aspect * this.sin);
  }

  down(u, v, h) {
    return this.y + this.scale * (this.near(u, v) * this.flat - h * TALL * this.steep);
  }

  // Number of the shade of a slope: heights, in shares of the full one, over the whole width and depth.
  shade(alongU, alongV) {
    const [x, y] = [-TALL * alongU, (-TALL * alongV) / this.aspect];
    const lit = (x * this.cos - y * this.sin) * LIGHT[0] + (x * this.sin + y * this.cos) * LIGHT[1] + LIGHT[2];
    const share = Math.max(0, lit / Math.sqrt(x * x + y * y + 1));
    return Math.round(Math.min(share, 1) * (SHADES - 1));
  }
}

export class Relief {
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.image = new ImageData(width, height);
    this.packed = new Uint32Array(this.image.data.buffer);
  }

  // Paint a mesh; `top` levels above the lowest one reach the full height. Returns the view.
  paint(mesh, { table, azimuth, elevation, aspect, top }) {
    this.packed.fill(0);
    this.shadeTable(table);
    const view = new View({ width: this.width, height: this.height, azimuth, elevation, aspect });
    const { levels, rows, columns } = mesh;
    this.project(mesh, view, top);
    for (let i = 0; i < rows - 1; i++) {
      const row = view.cos >= 0 ? i : rows - 2 - i;
      for (let j = 0; j < columns - 1; j++) {
        const a = row * columns + (view.sin >= 0 ? j : columns - 2 - j);
        const [b, c, d] = [a + 1, a + columns, a + columns + 1];
        const alongU = ((levels[b] + levels[d] - levels[a] - levels[c]) / 2 / top) * (columns - 1);
        const alongV = ((levels[c] + levels[d] - levels[a] - levels[b]) / 2 / top) * (rows - 1);
        const shade = view.shade(alongU, alongV) << 8;
        paintTriangle(this, levels, shade, a, b, c);
        paintTriangle(this, levels, shade, b, d, c);
      }
    }
    return view;
  }

  project({ levels, rows, columns }, view, top) {
    if (this.x?.length !== levels.length) {
      this.x = new Float32Array(levels.length);
      this.y = new Float32Array(levels.length);
    }
    const lowest = levels.reduce((least, level) => Math.min(least, level), LEVEL);
    for (let row = 0, at = 0; row < rows; row++) {
      const v = (row + 0.5) / rows;
      for (let column = 0; column < columns; column++, at++) {
        const u = (column + 0.5) / columns;
        this.x[at] = view.across(u, v);
        this.y[at] = view.down(u, v, Math.min((levels[at] - lowest) / top, 1));
      }
    }
  }

  // Each colour in each shade, made once for a table.
  shadeTable(table) {
    if (this.shadedFrom === table) return;
    this.shadedFrom = table;
    this.shaded = new Uint32Array(SHADES * 256);
    for (let shade = 0; shade < SHADES; shade++) {
      const share = DIMMEST + ((1 - DIMMEST) * shade) / (SHADES - 1);
      for (let level = 0; level < 256; level++) {
        const [red, green, blue] = [0, 8, 16].map((bits) => Math.round(((table[level] >>> bits) & 255) * share));
        this.shaded[(shade << 8) | level] = (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0;
      }
    }
  }
}
