const spots = JSON.parse(document.getElementById("spots").textContent);
const highs = {{ atlas.highs|safe }}, unit = {{ atlas.unit|tojson }}, commands = {{ atlas.commands|safe }};
const colors = ["#fff1dc", "#fdd6a5", "#f7b06d", "#e98a45", "#cc6127", "#a33f14", "#6e250b"];
const boxes = [...document.querySelectorAll(".spot")], chosen = document.getElementById("chosen");
const words = (value, more) => value === null ? "not known" : value + more;
function paint(metric) {
  boxes.forEach((box, k) => {
    const value = spots[k][metric], never = metric === "localize" && spots[k].never;
    const level = Math.min(Math.floor(value / highs[metric] * colors.length), colors.length - 1);
    box.setAttribute("fill", never ? "url(#never)" : value === null ? "#e6e8eb" : colors[level]);
    const text = never ? "half or more never localized" : words(value, "");
    box.setAttribute("aria-label", `spot at ${spots[k].at[0]}, ${spots[k].at[1]} ${unit}: ${text}`);
  });
  document.getElementById("high").textContent = highs[metric].toPrecision(3);
}
function cell(row, text, number) {
  const element = row.insertCell(); element.textContent = text; if (number) element.className = "number"; return element;
}
function choose(k) {
  const spot = spots[k], localize = spot.never ? "half or more never localized" : words(spot.localize, " pictures to localize from here");
  boxes.forEach((box, j) => box.classList.toggle("chosen", j === k));
  const heading = document.createElement("p");
  heading.textContent = `Spot at (${spot.at[0]}, ${spot.at[1]}) ${unit}: ${spot.updates} steps of ${spot.count} runs; median error ${words(spot.error, " " + unit)}, ${words(spot.wrong, " % wrong")}; median rank of the truth's reference ${words(spot.rank, "")}; ${spot.starts} searches began here${spot.starts ? ": " + localize : ""}.`;
  const table = document.createElement("table"); table.className = "stack";
  const head = table.createTHead().insertRow();
  [`Error (${unit})`, "Step", "Run", "Show it"].forEach(name => { const th = document.createElement("th"); th.textContent = name; head.append(th); });
  const body = table.createTBody();
  spot.runs.forEach(([name, label, update, error]) => {
    const row = body.insertRow();
    cell(row, error, true).dataset.name = `error (${unit})`; cell(row, update, true).dataset.name = "step"; cell(row, label);
    const code = document.createElement("code"); code.textContent = commands[name];
    const last = cell(row, ""); last.className = "last"; last.append(code);
  });
  chosen.replaceChildren(heading, table);
}
boxes.forEach((box, k) => {
  box.addEventListener("click", () => choose(k));
  box.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(k); } });
});
document.getElementById("ramp").innerHTML = colors.map(color => `<i style="background:${color}"></i>`).join("");
document.querySelectorAll("input[name=metric]").forEach(input => input.addEventListener("change", () => paint(input.value)));
paint("error");
