"use strict";
/* The table of a class: sorts, searches and filters its rows. The page is whole without it. */
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  const rows = [...body.rows];
  // Without case and accents; some letters have none to take off.
  const letters = { "ł": "l", "ø": "o", "đ": "d", "ß": "ss", "æ": "ae", "œ": "oe", "ı": "i", "’": "'", "‘": "'" };
  const plain = (text) => text.toLowerCase().normalize("NFD").replace(/\p{M}/gu, "")
    .replace(/[łøđßæœı’‘]/gu, (letter) => letters[letter]);
  const texts = new Map(rows.map((row) => [row, plain(row.textContent)]));

  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    const key = (row) => row.cells[column].dataset.sort ?? row.cells[column].textContent;
    button.addEventListener("click", () => {
      const rising = head.getAttribute("aria-sort") !== "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", rising ? "ascending" : "descending");
      const compare = (a, b) => {
        const [x, y] = [key(a), key(b)];
        const numbers = x !== "" && y !== "" && !Number.isNaN(x - y);
        return numbers ? x - y : x.localeCompare(y, undefined, { numeric: true });
      };
      rows.sort((a, b) => (rising ? compare(a, b) : compare(b, a)));
      body.append(...rows);
    });
  });

  // Controls, which would do nothing without this script.
  const bar = document.createElement("p");
  bar.className = "filters";
  const search = document.createElement("input");
  search.type = "search";
  search.id = "search";
  search.placeholder = "Name, number, file, remark";
  search.setAttribute("aria-label", "Search the submissions");
  const filter = document.createElement("select");
  filter.id = "filter";
  filter.setAttribute("aria-label", "Filter the submissions");
  const kinds = [
    ["", "all submissions"],
    ["td.total.open", "not wholly judged"],
    ["td.total:not(.full)", "points lost"],
    ["td.total.full", "nothing lost"],
    ["td.total.zero", "no points"],
    ["td.remarks:not(:empty)", "with remarks"],
  ];
  heads.forEach((head, column) => {
    const part = head.dataset.part;
    if (part) kinds.push([`td:nth-child(${column + 1}):is(.some, .zero, .open)`, `points lost in ${part}`]);
  });
  filter.append(...kinds.map(([value, text]) => new Option(text, value)));
  const found = document.createElement("output");
  bar.append(search, " ", filter, " ", found);
  table.parentElement.before(bar);

  const show = () => {
    const words = plain(search.value).split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const wanted = words.every((word) => texts.get(row).includes(word))
        && (filter.value === "" || row.querySelector(filter.value) !== null);
      row.hidden = !wanted;
      shown += wanted;
    }
    found.textContent = shown === rows.length ? "" : `${shown} of ${rows.length}`;
  };
  search.addEventListener("input", show);
  filter.addEventListener("change", show);
  // A browser may keep what was typed when the page is loaded again.
  show();
}
