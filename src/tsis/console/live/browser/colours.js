// From grey levels to colours, as tsis.imaging.colour_map makes them.

const FULL = 255;
const STOPS = 16; // of a gradient

// 256 packed colours, one for each level, of a map of 256 colours between two ends in levels; `gamma` is the exponent.
export function colourTable(colours, [low, high, gamma]) {
  const table = new Uint32Array(256);
  for (let level = 0; level < 256; level++) {
    const share = Math.min(Math.max((level - low) / (high - low), 0), 1);
    table[level] = colours[nearest(share ** gamma * FULL)];
  }
  return table;
}

// The same colours from the lower to the upper end, for a page's style.
export function gradient(colours, [, , gamma]) {
  const stops = Array.from({ length: STOPS + 1 }, (_, at) => colours[nearest((at / STOPS) ** gamma * FULL)]);
  const css = stops.map((packed) => `rgb(${packed & 255}, ${(packed >> 8) & 255}, ${(packed >> 16) & 255})`);
  return `linear-gradient(to right, ${css.join(", ")})`;
}

// The camera's grey level of one of 255 levels; a difference of frames begins below zero.
export function levelText(frame, level) {
  return ((frame?.zero ?? 0) + (level / FULL) * (frame?.fullScale || FULL)).toFixed(0);
}

// Halves go to the even neighbour, as NumPy rounds.
function nearest(value) {
  const floor = Math.floor(value);
  if (value - floor !== 0.5) return Math.round(value);
  return floor % 2 ? floor + 1 : floor;
}

// What elements in colours have in common.
export const coloured = {
  props: {
    address: String, // of the WebSocket
    map: String, // JSON of 256 packed colours, as a Uint32Array of canvas pixels holds them
    range: String, // JSON of the two ends of the colour map in levels of 255, and its exponent
    scale: String, // JSON of the size (x, y) of a pixel, mm; null when unknown
    label: String, // the image as text, for screen readers
  },
  computed: {
    // Each is parsed again when its text changes, and not with every other prop.
    colours() {
      return JSON.parse(this.map);
    },
    ends() {
      return JSON.parse(this.range);
    },
    mmPerPixel() {
      return JSON.parse(this.scale);
    },
  },
};
