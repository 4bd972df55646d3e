// Grey levels of the newest frame as bars, with what is wrong with the exposure.

import { streamOf } from "tsis-live";

const [WIDTH, HEIGHT] = [256, 96]; // of the drawing, which is scaled to its place

export default {
  template: `
    <figure class="histogram">
      <svg role="img" :aria-label="label" viewBox="0 0 ${WIDTH + 4} ${HEIGHT}" preserveAspectRatio="none">
        <path class="histogram-bars" :d="bars" />
        <path class="histogram-full" d="M${WIDTH + 2} 0V${HEIGHT}" />
      </svg>
      <figcaption class="histogram-caption">
        <span>0</span>
        <label><input type="checkbox" v-model="logarithmic" /> logarithmic</label>
        <span>full scale {{ fullScale }}</span>
      </figcaption>
      <p class="histogram-clipped">{{ clipped }}</p>
      <p v-for="sentence in warnings" :key="sentence" class="doubtful" role="status">Exposure: {{ sentence }}</p>
    </figure>`,
  props: {
    address: String, // of the WebSocket
    log: Boolean, // how the number of pixels is drawn at first
    label: String, // what is seen, for those who do not see it
  },
  data: () => ({ bars: "", clipped: "", fullScale: "", logarithmic: false, warnings: [] }),
  mounted() {
    this.logarithmic = this.log;
    this.leave = streamOf(this.address).join({
      analysis: (analysis) => this.see(analysis),
      frame: (frame) => (this.fullScale = String(frame.fullScale)),
    });
  },
  unmounted() {
    this.leave();
  },
  watch: {
    log(value) {
      this.logarithmic = value;
    },
    logarithmic() {
      this.draw();
    },
  },
  methods: {
    see(analysis) {
      this.counts = analysis?.histogram ?? [];
      this.warnings = analysis?.warnings ?? [];
      this.clipped = analysis ? `${(100 * analysis.clipped_share).toFixed(2)} % of the pixels at full scale` : "";
      this.draw();
    },
    draw() {
      const counts = this.counts ?? [];
      const height = this.logarithmic ? (count) => Math.log10(1 + count) : (count) => count;
      const most = height(Math.max(1, ...counts));
      const wide = WIDTH / Math.max(1, counts.length);
      this.bars = counts
        .map((count, bin) => `M${bin * wide} ${HEIGHT}v${(-HEIGHT * height(count)) / most}h${wide}V${HEIGHT}z`)
        .join("");
    },
  },
};
