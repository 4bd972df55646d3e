// The live image as a relief that can be turned.

import { blockMeans, coloured, colourTable, drawAxes, endsOf, Relief, streamOf } from "tsis-live";

const ACROSS = 64; // blocks
const EVERY_MS = 55; // between two drawings: a hand sees no more, and the live image goes before
const HEIGHT = 0.7; // of the drawing over its width
const MOST_PIXELS = 640; // of its width
const TURN = Math.PI / 18; // by an arrow key
const START = { azimuth: -0.5, elevation: 0.65 };
const [FLATTEST, STEEPEST] = [0.15, Math.PI / 2];
const TOPS = [25, 50, 100, 150, 200, 255]; // heights in grey levels
const REMEMBERED = 120;

export default {
  template: `
    <figure class="surface">
      <canvas ref="canvas" class="surface-image" tabindex="0" role="img" :aria-label="label"
        @keydown="turnByKey" @pointerdown="grasp" @pointermove="drag" @pointerup="release" @pointercancel="release">
      </canvas>
      <figcaption class="live-caption"><span>Drag, or press arrow keys here, to turn it</span>
        <button type="button" class="surface-reset" @click="reset">Turn back</button></figcaption>
    </figure>`,
  mixins: [coloured],
  mounted() {
    this.turned = { ...START };
    this.drawn = [];
    this.top = TOPS[0];
    this.colour();
    this.observer = new ResizeObserver(() => this.fit());
    this.observer.observe(this.$refs.canvas);
    this.fit();
    this.leave = streamOf(this.address).join({
      frame: (frame) => this.see(frame),
      analysis: (analysis) => this.seeEnds(analysis),
    });
  },
  unmounted() {
    this.leave();
    this.observer.disconnect();
  },
  watch: {
    colours() {
      this.colour();
      this.draw();
    },
    ends() {
      this.colour();
      this.draw();
    },
    mmPerPixel() {
      this.draw();
    },
  },
  methods: {
    seeEnds(analysis) {
      this.counts = analysis?.histogram;
      if (this.ends === "auto") this.colour();
    },
    colour() {
      const ends = endsOf(this.ends, this.counts);
      const name = ends.join();
      if (name === this.endsNow && this.colours === this.coloursNow) return; // shades are made anew for a new table
      [this.endsNow, this.coloursNow] = [name, this.colours];
      this.table = colourTable(this.colours, ends);
    },
    fit() {
      const wide = this.$refs.canvas.clientWidth * window.devicePixelRatio;
      const width = Math.max(200, Math.min(MOST_PIXELS, Math.round(wide)));
      if (this.relief?.width === width) return;
      const height = Math.round(HEIGHT * width);
      [this.$refs.canvas.width, this.$refs.canvas.height] = [width, height];
      this.context = this.$refs.canvas.getContext("2d");
      this.relief = new Relief(width, height);
      this.draw();
    },
    see(frame) {
      const now = performance.now();
      if (now - (this.seenAt ?? -EVERY_MS) < EVERY_MS) return;
      this.seenAt = now;
      this.frame = { rows: frame.rows, columns: frame.columns };
      this.mesh = blockMeans(frame, ACROSS);
      this.draw();
      this.drawn.push(now);
      if (this.drawn.length > REMEMBERED) this.drawn.shift();
    },
    draw() {
      if (!this.mesh || !this.relief) return;
      const { rows, columns } = this.frame;
      const [wide, high] = this.mmPerPixel ?? [1, 1];
      const [width, depth] = [columns * wide, rows * high];
      this.raise();
      const view = this.relief.paint(this.mesh, {
        ...this.turned,
        table: this.table,
        aspect: depth / width,
        top: this.top,
      });
      this.context.putImageData(this.relief.image, 0, 0);
      const colour = getComputedStyle(this.$refs.canvas).color;
      drawAxes(this.context, view, { width, depth, unit: this.mmPerPixel ? "mm" : "pixels", top: this.top, colour });
    },
    // The height of the box follows the picture in steps, and not back at once, so that it does not flicker.
    raise() {
      let [low, high] = [255, 0];
      for (const level of this.mesh.levels) [low, high] = [Math.min(low, level), Math.max(high, level)];
      const extent = high - low;
      if (extent > this.top || extent < 0.4 * this.top) this.top = TOPS.find((top) => top >= extent) ?? 255;
    },
    turn(azimuth, elevation) {
      this.turned.azimuth = (this.turned.azimuth + azimuth) % (2 * Math.PI);
      this.turned.elevation = Math.min(Math.max(this.turned.elevation + elevation, FLATTEST), STEEPEST);
      cancelAnimationFrame(this.asked);
      this.asked = requestAnimationFrame(() => this.draw());
    },
    reset() {
      this.turned = { ...START };
      this.draw();
    },
    turnByKey(event) {
      const turns = { ArrowLeft: [TURN, 0], ArrowRight: [-TURN, 0], ArrowUp: [0, TURN], ArrowDown: [0, -TURN] };
      if (event.key === "Home") this.reset();
      else if (turns[event.key]) this.turn(...turns[event.key]);
      else return;
      event.preventDefault();
      event.stopPropagation(); // elsewhere arrows choose a target
    },
    grasp(event) {
      this.grasped = [event.clientX, event.clientY];
      this.$refs.canvas.setPointerCapture(event.pointerId);
    },
    drag(event) {
      if (!this.grasped) return;
      const [x, y] = this.grasped;
      this.grasped = [event.clientX, event.clientY];
      this.turn((x - event.clientX) * 0.01, (event.clientY - y) * 0.01);
    },
    release() {
      this.grasped = null;
    },
    // For those who judge it: when it was drawn for a new frame, ms.
    measured() {
      return this.drawn;
    },
  },
};
