// Reports whether the page is visible, and the operator's name that this browser keeps.

export default {
  template: `<span hidden></span>`,
  emits: ["visible", "operator"],
  mounted() {
    this.report = () => this.$emit("visible", !document.hidden);
    document.addEventListener("visibilitychange", this.report);
    if (document.hidden) this.report();
    try {
      const name = localStorage.getItem("tsis-operator");
      if (name) this.$emit("operator", name);
    } catch { /* storage is refused: the name is asked for again */ }
  },
  unmounted() {
    document.removeEventListener("visibilitychange", this.report);
  },
};
