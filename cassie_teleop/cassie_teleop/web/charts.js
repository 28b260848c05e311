// Strip charts of the last seconds, drawn by ECharts.
import { echarts } from "/lib/echart/index.js";

const SECONDS = 20;
const OUTPUTS = [
  "torso roll", "stance hip yaw", "torso pitch", "stance leg length", "swing leg roll", "swing hip yaw",
  "swing leg pitch", "swing leg length", "swing foot pitch",
];
const DRIVES = ["hip roll", "hip yaw", "hip pitch", "knee", "toe"];
const COLOURS = ["#4aa3ff", "#f2a25c", "#58c79a", "#e57f93", "#b79cf2", "#d7cc6a", "#6cc7d9", "#c98f6b", "#9aa7b5"];
const THREE_LINES = [
  { name: "commanded", color: "#98a4b0", dash: "dotted" },
  { name: "limited", color: "#f2a25c", dash: "solid" },
  { name: "achieved", color: "#4aa3ff", dash: "solid" },
];

class Strip {
  constructor(id, lines, bounds, rows = 1) {
    this.element = document.getElementById(id);
    this.rows = [];
    this.count = lines.length;
    this.chart = echarts.init(this.element, null, { renderer: "canvas" });
    this.chart.setOption({
      animation: false,
      textStyle: { color: "#98a4b0" },
      grid: { left: 40, right: 8, top: 25 + 16 * (rows - 1), bottom: 18 },
      legend: {
        top: 0, left: 0, right: 0, itemWidth: 14, itemHeight: 2, itemGap: 7, icon: "rect", padding: [3, 4, 0, 4],
        textStyle: { color: "#98a4b0", fontSize: 10 }, data: [...new Set(lines.map((line) => line.name))],
      },
      xAxis: {
        type: "value", min: -SECONDS, max: 0, interval: 5, axisLine: { show: false }, axisTick: { show: false },
        axisLabel: { formatter: (x) => (x === 0 ? "now" : `${x} s`), fontSize: 10 }, splitLine: { lineStyle: { color: "#262e36" } },
      },
      yAxis: {
        type: "value", ...bounds, splitNumber: 3, axisLabel: { fontSize: 10, hideOverlap: true }, splitLine: { lineStyle: { color: "#262e36" } },
      },
      series: lines.map((line) => ({
        name: line.name, type: "line", showSymbol: false, silent: true, color: line.color,
        lineStyle: { width: 1.5, type: line.dash ?? "solid" }, data: [],
      })),
    });
    new ResizeObserver(() => this.chart.resize()).observe(this.element);
  }

  add(time, values) {
    this.rows.push([time, ...Array.from({ length: this.count }, (_, i) => values?.[i] ?? null)]);
    while (this.rows[0][0] < time - SECONDS) this.rows.shift();
  }

  draw() {
    const { right, bottom, top, left } = this.element.getBoundingClientRect();
    if (right <= 0 || bottom <= 0 || left >= innerWidth || top >= innerHeight || !this.rows.length) return;
    const now = this.rows.at(-1)[0];
    const series = [];
    for (let i = 1; i <= this.count; i++) series.push({ data: this.rows.map((row) => [row[0] - now, row[i]]) });
    this.chart.setOption({ series });
  }
}

export class Charts {
  constructor() {
    const span = (least) => ({
      min: ({ min, max }) => Math.floor(10 * Math.min(min, (min + max - least) / 2)) / 10,
      max: ({ min, max }) => Math.ceil(10 * Math.max(max, (min + max + least) / 2)) / 10,
    });
    const drives = ["left", "right"].flatMap((leg) =>
      DRIVES.map((name, i) => ({ name, color: COLOURS[i], dash: leg === "left" ? "solid" : "dashed" })),
    );
    this.speed = new Strip("chart-speed", THREE_LINES, span(0.4));
    this.height = new Strip("chart-height", THREE_LINES, span(0.2));
    this.torque = new Strip("chart-torque", drives, { min: -1, max: 1, interval: 0.5 });
    this.outputs = new Strip("chart-outputs", OUTPUTS.map((name, i) => ({ name, color: COLOURS[i] })), { scale: true }, 3);
  }

  add(time, frame, height) {
    this.speed.add(time, [frame.asked?.[0], frame.limited?.[0], frame.achieved?.[0]]);
    this.height.add(time, [frame.asked?.[3], frame.limited?.[3], height]);
    this.torque.add(time, frame.torque);
    this.outputs.add(time, frame.outputs);
  }

  draw() {
    for (const strip of [this.speed, this.height, this.torque, this.outputs]) strip.draw();
  }
}
