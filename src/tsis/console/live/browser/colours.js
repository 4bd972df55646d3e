// From grey levels to colours, as tsis.imaging.colour_map makes them.

const DARKEST = 0.01; // share of the pixels that "auto" takes for darker than the map's lower end,
const BRIGHTEST = 0.999; // and of those that it takes for darker than its upper end
const LEAST = 24; // levels between the two ends, so that noise alone does not become a picture
const FULL = 255;

// 256 packed colours, one for each level, of a map of 256 colours between two ends in levels.
export function colourTable(colours, [low, high]) {
  const table = new Uint32Array(256);
  for (let level = 0; level < 256; level++) {
    const share = Math.min(Math.max((level - low) / (high - low), 0), 1);
    table[level] = colours[nearest(share * FULL)];
  }
  return table;
}

// The two ends in levels: those that were chosen, or where nearly all pixels of a histogram lie.
export function endsOf(chosen, counts) {
  if (chosen !== "auto") return chosen;
  if (!counts) return [0, FULL];
  const low = Math.floor(quantile(counts, DARKEST));
  const high = Math.ceil(quantile(counts, BRIGHTEST));
  if (high - low >= LEAST) return [low, high];
  const start = Math.min(low, FULL - LEAST);
  return [start, start + LEAST];
}

// The level below which a share of the pixels lies; inside a bin they are taken as evenly spread.
function quantile(counts, share) {
  const rank = share * counts.reduce((sum, count) => sum + count, 0);
  let below = 0;
  for (let bin = 0; bin < counts.length; bin++) {
    if (counts[bin] > 0 && below + counts[bin] >= rank) {
      return ((bin + (rank - below) / counts[bin]) / counts.length) * FULL;
    }
    below += counts[bin];
  }
  return FULL;
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
    range: String, // JSON of the ends of the colour map: "auto", or two levels of 255
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
