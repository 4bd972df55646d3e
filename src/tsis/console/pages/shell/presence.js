// Reports whether the page is visible.

export default {
  template: `<span hidden></span>`,
  emits: ["visible"],
  mounted() {
    this.report = () => this.$emit("visible", !document.hidden);
    document.addEventListener("visibilitychange", this.report);
    if (document.hidden) this.report();
  },
  unmounted() {
    document.removeEventListener("visibilitychange", this.report);
  },
};
