// The two views of the page as tabs (WAI-ARIA): the driving view, and the group. A page that is
// opened shows the driving view.

export class Tabs {
  #tabs;

  constructor(list, onChange) {
    this.#tabs = [...list.children];
    this.onChange = onChange;
    for (const tab of this.#tabs) {
      tab.onclick = () => this.#select(tab);
      tab.onkeydown = (event) => this.#step(tab, event);
    }
    this.#select(this.#tabs[0]);
  }

  #select(chosen) {
    for (const tab of this.#tabs) {
      tab.setAttribute("aria-selected", String(tab === chosen));
      tab.tabIndex = tab === chosen ? 0 : -1;
      document.getElementById(tab.getAttribute("aria-controls")).hidden = tab !== chosen;
    }
    this.onChange();
  }

  #step(tab, event) {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (by === undefined) return;
    const next = this.#tabs.at((this.#tabs.indexOf(tab) + by) % this.#tabs.length);
    this.#select(next);
    next.focus();
  }
}
