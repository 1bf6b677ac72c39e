// Links map and traces: the step under the pointer, or of the slider, is marked in all of them, and told in words.
(() => {
  const data = JSON.parse(document.getElementById("steps").textContent);
  const block = document.querySelector(".linked");
  const plan = block.querySelector(".plan svg"), charts = [...block.querySelectorAll(".chart svg")];
  const lanes = block.querySelector(".lanes svg");  // as wide as the charts
  const slider = block.querySelector(".readout input");
  const words = [...block.querySelectorAll(".readout [data-run]")];
  const head = block.querySelector(".readout .when");
  const told = data.charts.filter((chart) => chart.told);
  const last = data.steps.length - 1;
  const hasTruth = data.poses.length > words.length;
  let shown = 0;

  // Where a value lies in a drawing: see _axes in linked.py.
  const across = (axes, x) => axes[4] + (x - axes[0]) / (axes[1] - axes[0] || 1) * axes[6];
  const down = (axes, y) => axes[5] + axes[7] - (y - axes[2]) / (axes[3] - axes[2] || 1) * axes[7];
  const within = (low, value, high) => Math.min(Math.max(value, low), high);

  function sayPose(pose) {
    const [x, y] = pose.map((value) => value.toFixed(data.digits));
    return `(${x}, ${y}) ${data.unit}, ${pose[2]} deg`;
  }

  function sayValue(chart, value) {
    if (value === null) return `${chart.name} not known`;
    if (chart.unit === "share") return `${chart.name} ${Math.round(100 * value)} %`;
    return `${chart.name} ${value.toFixed(chart.unit === data.unit ? data.digits : 1)} ${chart.unit}`;
  }

  function placeMarks(row) {
    const marks = [...plan.querySelectorAll(".now.robot")], links = [...plan.querySelectorAll(".now.off")];
    const spots = data.poses.map((poses) => poses[row]);
    const size = Math.max(1, 1 / (plan.getScreenCTM().a || 1)).toFixed(2);  // as large on a small map
    marks.forEach((mark, k) => {
      mark.style.display = spots[k] ? "" : "none";
      if (!spots[k]) return;
      const x = across(data.map, spots[k][0]), y = down(data.map, spots[k][1]);
      mark.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${-spots[k][2]}) scale(${size})`);
    });
    links.forEach((link, k) => {  // from truth to the estimate of each run
      const truth = spots[0], estimate = spots[k + 1];
      link.style.display = truth && estimate ? "" : "none";
      if (!truth || !estimate) return;
      link.setAttribute("x1", across(data.map, truth[0]).toFixed(1));
      link.setAttribute("y1", down(data.map, truth[1]).toFixed(1));
      link.setAttribute("x2", across(data.map, estimate[0]).toFixed(1));
      link.setAttribute("y2", down(data.map, estimate[1]).toFixed(1));
    });
    return spots;
  }

  function placeCursors(row) {
    const x = across(data.charts[0].axes, data.steps[row]).toFixed(1);
    lanes.querySelector(".now.cursor").setAttribute("transform", `translate(${x} 0)`);
    charts.forEach((svg, k) => {
      const chart = data.charts[k], x = across(chart.axes, data.steps[row]).toFixed(1);
      svg.querySelector(".now.cursor").setAttribute("transform", `translate(${x} 0)`);
      svg.querySelectorAll(".now.value").forEach((dot, run) => {
        const value = chart.values[run][row];
        dot.style.display = value === null ? "none" : "";
        if (value === null) return;
        dot.setAttribute("cx", x);
        dot.setAttribute("cy", down(chart.axes, value).toFixed(1));
      });
    });
  }

  function show(row) {
    shown = within(0, row, last);
    const spots = placeMarks(shown), truth = hasTruth ? spots[0] : null;
    placeCursors(shown);
    slider.value = shown;
    const known = truth ? `; truth ${sayPose(truth)}` : "";
    head.textContent = `Step ${data.steps[shown]}, ${data.times[shown].toFixed(1)} s${known}`;
    words.forEach((element, run) => {
      const estimate = spots[run + hasTruth];
      const values = told.map((chart) => sayValue(chart, chart.values[run][shown]));
      element.textContent = [estimate ? `at ${sayPose(estimate)}` : "no estimate", ...values].join("; ");
    });
    slider.setAttribute("aria-valuetext", [head, ...words].map((element) => element.textContent).join(". "));
  }

  // The pointer's place in the units of a drawing.
  function spot(svg, event) {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [at.x, at.y];
  }

  function nearestStep(step) {
    let best = 0;
    data.steps.forEach((other, row) => {
      if (Math.abs(other - step) < Math.abs(data.steps[best] - step)) best = row;
    });
    return best;
  }

  function nearestPlace(x, y) {
    let best = shown, least = 30;  // px: farther away nothing is meant
    data.poses.forEach((poses) => poses.forEach((pose, row) => {
      if (!pose) return;
      const far = Math.hypot(across(data.map, pose[0]) - x, down(data.map, pose[1]) - y);
      if (far < least) [best, least] = [row, far];
    }));
    return best;
  }

  function follow(svg, rowAt) {
    for (const kind of ["pointermove", "pointerdown"]) {
      svg.addEventListener(kind, (event) => show(rowAt(...spot(svg, event))));
    }
  }

  // Text stays readable where a drawing is shown smaller than it was made.
  function fit() {
    for (const svg of [plan, lanes, ...charts]) {
      const scale = svg.getScreenCTM().a || 1;
      svg.style.setProperty("--per-px", Math.max(1, 1 / scale).toFixed(3));
    }
  }

  [lanes, ...charts].forEach((svg) => {
    const [low, high, , , left, , width] = data.charts[0].axes;
    follow(svg, (x) => nearestStep(low + (x - left) / width * (high - low)));
  });
  follow(plan, nearestPlace);
  slider.max = last;
  slider.addEventListener("input", () => show(Number(slider.value)));
  document.addEventListener("keydown", (event) => {
    const free = [document.body, document.documentElement, null].includes(document.activeElement);
    const by = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    if (!by || !free || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    show(shown + by);
  });
  addEventListener("resize", () => { fit(); show(shown); });
  block.classList.add("live");
  fit();
  show(data.first);
})();
