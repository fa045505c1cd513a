"use strict";
/* The page of `umbra watch`: says what the last save is at, and loads the report again when it is there. */
const frame = document.getElementById("report");
const status = document.getElementById("status");
const NAMES = { running: "Checking", done: "Done", failed: "No report" };
let reports = -1;

function show({ stage, message, look, reports: count, libraries, fresh }) {
  document.body.className = stage;
  status.textContent = `${NAMES[stage]}: ${message}`;
  tellLive({ libraries, fresh });
  if (count === reports) return;
  reports = count;
  if (count > 0) reload(look);
}

/** Loads the report where the reader is in it, the folded parts as they are. */
function reload(look) {
  const page = frame.contentWindow;
  let place = 0;
  let open = [];
  try {
    place = page.scrollY;
    open = [...page.document.querySelectorAll("details[open] > summary")].map((summary) => summary.textContent);
  } catch {
    // Nothing was loaded yet.
  }
  frame.addEventListener("load", () => {
    for (const summary of frame.contentDocument.querySelectorAll("details > summary")) {
      if (open.includes(summary.textContent)) summary.parentElement.open = true;
    }
    frame.contentWindow.scrollTo(0, place);
  }, { once: true });
  frame.src = `${look}/${frame.dataset.page}`;
}

const events = new EventSource("events");
events.addEventListener("message", (event) => show(JSON.parse(event.data)));
events.addEventListener("error", () => {
  document.body.className = "failed";
  status.textContent = "umbra watch has ended";
});
