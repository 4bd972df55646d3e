// Tells whether the page can be seen.

export default {
  template: `<span hidden></span>`,
  emits: ["seen"],
  mounted() {
    this.tell = () => this.$emit("seen", !document.hidden);
    document.addEventListener("visibilitychange", this.tell);
    if (document.hidden) this.tell();
  },
  unmounted() {
    document.removeEventListener("visibilitychange", this.tell);
  },
};
