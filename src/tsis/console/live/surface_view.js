// The live image as a relief that can be turned, by ECharts GL.

import { coloured, levelText, streamOf } from "tsis-live";
import { echarts, loadEchartsGL } from "nicegui-echart";

const ACROSS = 64; // blocks
const EVERY_MS = 200; // between two drawings: the live image goes before
const TURNS = { ArrowLeft: ["beta", -10], ArrowRight: ["beta", 10], ArrowUp: ["alpha", 10], ArrowDown: ["alpha", -10] };
const START = { alpha: 35, beta: 25 };
const TOPS = [25, 50, 100, 150, 200, 255]; // heights in grey levels
const REMEMBERED = 120;

export default {
  template: `
    <figure class="surface">
      <div ref="place" class="surface-image" tabindex="0" role="img" :aria-label="label" @keydown="turn"></div>
      <figcaption class="live-caption"><span>{{ refused || "Drag, or press arrow keys here, to turn it" }}</span>
        <button type="button" class="surface-reset" @click="reset">Turn back</button></figcaption>
    </figure>`,
  mixins: [coloured],
  data: () => ({ refused: "" }),
  async mounted() {
    this.drawn = [];
    await loadEchartsGL();
    if (!this.$refs.place) return; // it is gone already
    if (!document.createElement("canvas").getContext("webgl")) {
      this.refused = "This browser shows no relief: it has no WebGL.";
      return;
    }
    this.chart = echarts.init(this.$refs.place);
    this.observer = new ResizeObserver(() => this.chart.resize());
    this.observer.observe(this.$refs.place);
    this.leave = streamOf(this.address).join({ frame: (frame) => this.see(frame) });
  },
  unmounted() {
    this.leave?.();
    this.observer?.disconnect();
    this.chart?.dispose();
  },
  watch: {
    colours() {
      this.draw();
    },
    ends() {
      this.draw();
    },
  },
  methods: {
    see(frame) {
      const now = performance.now();
      if (now - (this.drawn.at(-1) ?? -EVERY_MS) < EVERY_MS) return;
      this.frame = frame;
      this.draw();
      this.drawn.push(now);
      if (this.drawn.length > REMEMBERED) this.drawn.shift();
    },
    draw() {
      if (!this.frame || !this.chart) return;
      const { rows, columns } = this.frame;
      const [wide, high] = this.mmPerPixel ?? [1, 1];
      const [width, depth, unit] = [columns * wide, rows * high, this.mmPerPixel ? "mm" : "pixels"];
      const mesh = blockMeans(this.frame, ACROSS);
      const data = Array.from(mesh.levels, (level, at) => [
        ((at % mesh.columns) + 0.5) * mesh.side * wide, (Math.floor(at / mesh.columns) + 0.5) * mesh.side * high, level,
      ]);
      const levels = data.map((place) => place[2]);
      const low = Math.min(...levels);
      // The height of the box follows the picture in steps, and not back at once, so that it does not flicker.
      const extent = Math.max(...levels) - low;
      if (!this.top || extent > this.top || extent < 0.4 * this.top) this.top = TOPS.find((top) => top >= extent) ?? 255;
      const colour = getComputedStyle(this.$refs.place).color;
      const axis = { type: "value", min: 0, axisLine: { lineStyle: { color: colour } }, axisLabel: { color: colour, formatter: (place) => +place.toFixed(1) }, nameTextStyle: { color: colour } };
      const [from, to, gamma] = this.ends;
      const share = (level) => Math.min(Math.max((level - from) / (to - from), 0), 1) ** gamma;
      this.chart.setOption({
        grid3D: { boxWidth: 100, boxDepth: (100 * depth) / width, boxHeight: 42, light: { main: { intensity: 1.2 } },
          ...(this.drawn.length ? {} : { viewControl: { ...START, animation: false } }) },
        xAxis3D: { ...axis, max: width, name: `x, ${unit}` },
        yAxis3D: { ...axis, max: depth, name: `y, ${unit}`, inverse: true },
        zAxis3D: { ...axis, min: low, max: low + this.top, name: "grey", axisLabel: { color: colour, formatter: (level) => levelText(this.frame, level) } },
        visualMap: { show: false, min: 0, max: 255, inRange: { color: this.scale256(share) } },
        series: [{ type: "surface", data, dataShape: [mesh.rows, mesh.columns], wireframe: { show: false }, shading: "lambert" }],
      });
    },
    // The colours of the levels 0 to 255.
    scale256(share) {
      return Array.from({ length: 256 }, (_, level) => {
        const packed = this.colours[Math.round(255 * share(level))];
        return `rgb(${packed & 255}, ${(packed >> 8) & 255}, ${(packed >> 16) & 255})`;
      });
    },
    reset() {
      this.turnTo(START);
    },
    turnTo({ alpha, beta }) {
      if (!this.chart?.getOption()) return; // nothing is drawn yet
      this.chart.setOption({ grid3D: { viewControl: { alpha, beta } } });
    },
    turn(event) {
      if (!(event.key in TURNS) || !this.chart) return;
      const [angle, by] = TURNS[event.key];
      const { alpha, beta } = this.turned();
      this.turnTo({ alpha, beta, [angle]: { alpha, beta }[angle] + by });
      event.preventDefault();
      event.stopPropagation(); // elsewhere arrows choose a target
    },
    turned() {
      return this.chart.getOption().grid3D[0].viewControl;
    },
    // For those who judge it: when it was drawn for a new frame, ms.
    measured() {
      return this.drawn;
    },
  },
};

// Means of square blocks, about so many across.
function blockMeans(frame, across) {
  const side = Math.max(1, Math.floor(frame.columns / across));
  const [columns, rows] = [Math.floor(frame.columns / side), Math.floor(frame.rows / side)];
  const levels = new Float32Array(rows * columns);
  for (let y = 0; y < rows * side; y++) {
    const base = Math.floor(y / side) * columns;
    for (let x = 0; x < columns * side; x++) levels[base + Math.floor(x / side)] += frame.pixels[y * frame.columns + x];
  }
  return { levels: levels.map((sum) => sum / side ** 2), rows, columns, side };
}
