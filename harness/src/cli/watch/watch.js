"use strict";
/* The page of `umbra watch`: says what the last save is at, and loads the report again when it is there. */
const report = document.getElementById("report");
const mark = document.getElementById("mark");
const status = document.getElementById("status");
const NAMES = { running: "Checking", done: "Nothing is wrong", lost: "Points are missing", refused: "Does not compile", failed: "No report" };
const EARLIER = {
  nothing: "The report below is of an earlier save.",
  offline: "The report below is of an earlier save. Shaders alone changed since: its offline results hold, and are run again.",
};
let reports = -1;

function show({ stage, message, verdict, reports: count, libraries, fresh, holds }) {
  document.body.className = stage;
  status.textContent = `${NAMES[stage]}: ${message}`;
  document.title = `${{ running: "checking …", failed: "no report" }[stage] ?? verdict} - umbra watch`;
  tellLive({ stage, libraries, fresh });
  mark.hidden = count === 0 || holds === "all";
  mark.textContent = EARLIER[holds] ?? "";
  if (count === reports) return;
  reports = count;
  if (count > 0) reload();
}

/** Loads the report where the reader is in it, the folded parts as they are. */
function reload() {
  const page = report.contentWindow;
  let place = 0;
  let open = [];
  try {
    place = page.scrollY;
    open = [...page.document.querySelectorAll("details[open] > summary")].map((summary) => summary.textContent);
  } catch {
    // Nothing was loaded yet.
  }
  report.addEventListener("load", () => {
    for (const summary of report.contentDocument.querySelectorAll("details > summary")) {
      if (open.includes(summary.textContent)) summary.parentElement.open = true;
    }
    report.contentWindow.scrollTo(0, place);
  }, { once: true });
  report.src = `report/${report.dataset.page}`;
}

const events = new EventSource("events");
events.addEventListener("message", (event) => show(JSON.parse(event.data)));
events.addEventListener("error", () => {
  document.body.className = "failed";
  document.title = "ended - umbra watch";
  status.textContent = "umbra watch has ended";
});
