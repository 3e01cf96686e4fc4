// a table that is wider than its place is shown row by row, each cell beside its column's name
addEventListener("load", () => {
  const wrappers = [...document.querySelectorAll("article .table-wrapper")];
  const places = wrappers.filter((one) => !one.querySelector(".keys, .options"));
  for (const place of places) {
    const names = [...place.querySelectorAll("thead th")].map((name) => name.textContent);
    for (const row of place.querySelectorAll("tbody tr"))
      [...row.cells].forEach((cell, k) => { cell.dataset.column = names[k] ?? ""; });
  }
  const fit = () => {
    for (const place of places) {
      place.classList.remove("as-rows");
      place.classList.toggle("as-rows", place.scrollWidth > place.clientWidth + 1);
    }
  };
  addEventListener("resize", fit);
  fit();
  window.MathJax?.startup?.promise?.then(fit);  // formulas are wider when they are set
});
