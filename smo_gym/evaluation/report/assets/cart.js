// The cart pendulum on a canvas. theta = 0 hangs where g < 0 and stands where g > 0; the bob is l sin(theta) beside the cart.

const [LEAST, MOST] = [190, 360]; // pixels a metre
const LABELS = 10; // pixels below

class Cart {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
  }

  show(run, [, , rod, gravity], arm) {
    const up = gravity > 0 ? 1 : -1;
    const extremes = (name) => (run[name] ? [Math.min(...run[name]), Math.max(...run[name])] : [0, 0]);
    const [left, right] = extremes("h"), [from, to] = extremes("reference_h");
    const heights = Array.from(run.theta, (theta) => up * rod * Math.cos(theta));
    Object.assign(this, { run, rod, up, arm });
    this.left = Math.min(left, from, 0) - rod - 0.25;
    this.right = Math.max(right, to, 0) + rod + 0.25;
    this.top = Math.max(0.18, ...heights) + 0.1;
    this.bottom = Math.min(-0.22, ...heights) - 0.1;
    this.strongest = Math.max(1e-9, ...run.force.map(Math.abs));
  }

  draw(time) {
    const { canvas, pen, run } = this;
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth;
    const wide = this.right - this.left, tall = this.top - this.bottom;
    const scale = (this.scale = Math.min(Math.max(width / wide, LEAST), MOST));
    const height = Math.round(scale * tall + LABELS);
    canvas.style.height = `${height}px`;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    }
    const h = at(run, "h", time), room = Math.max(wide - width / scale, 0) / 2, middle = (this.left + this.right) / 2;
    this.x0 = width / 2 - scale * Math.min(Math.max(h, middle - room), middle + room); // follows where not all fits
    this.y0 = scale * this.top;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    this.track(width);
    if (run.reference_h) {
      const look = { stroke: colour("--quiet"), dash: [2, 4] };
      this.cart(at(run, "reference_h", time), at(run, "reference_theta", time), look);
    }
    this.cart(h, at(run, "theta", time), { stroke: this.arm, fill: this.arm });
    this.cart(at(run, "estimate_h", time), at(run, "estimate_theta", time), { stroke: colour("--ink"), dash: [6, 4] });
    this.force(h, at(run, "force", time));
  }

  track(width) {
    const { pen, scale, x0, y0 } = this;
    const floor = y0 + 0.09 * scale;
    pen.lineWidth = 1;
    pen.strokeStyle = colour("--line");
    pen.fillStyle = colour("--quiet");
    pen.font = `11px ${colour("--sans")}`;
    pen.textAlign = "center";
    pen.setLineDash([]);
    pen.beginPath();
    pen.moveTo(0, floor);
    pen.lineTo(width, floor);
    const step = [0.1, 0.25, 0.5, 1, 2, 5, 10, 50, 250, 1000].find((metres) => metres * scale > 55) ?? 10000;
    for (let k = Math.ceil(-x0 / scale / step); k * step * scale + x0 < width; k++) {
      const x = x0 + k * step * scale;
      pen.moveTo(x, floor);
      pen.lineTo(x, floor + 5);
      pen.fillText(`${+(k * step).toFixed(2)}${k === 0 ? " m" : ""}`.replace("-", "−"), x, floor + 17);
    }
    pen.stroke();
  }

  cart(h, theta, { stroke, fill, dash = [] }) {
    const { pen, scale, x0, y0, rod, up } = this;
    const x = x0 + h * scale, half = 0.13 * scale, tall = 0.065 * scale;
    const bob = [x + rod * Math.sin(theta) * scale, y0 - up * rod * Math.cos(theta) * scale];
    pen.strokeStyle = stroke;
    pen.setLineDash(dash);
    pen.lineWidth = fill ? 2 : 1.5;
    pen.beginPath();
    pen.roundRect(x - half, y0 - tall, 2 * half, 2 * tall, 4);
    if (fill) {
      pen.globalAlpha = 0.3;
      pen.fillStyle = fill;
      pen.fill();
      pen.globalAlpha = 1;
    }
    pen.stroke();
    pen.lineWidth = fill ? 3.5 : 1.5;
    pen.lineCap = "round";
    pen.beginPath();
    pen.moveTo(x, y0);
    pen.lineTo(...bob);
    pen.stroke();
    pen.lineWidth = fill ? 2 : 1.5;
    pen.beginPath();
    pen.arc(...bob, Math.max(0.04 * scale, 5), 0, 2 * Math.PI);
    if (fill) {
      pen.fillStyle = fill;
      pen.fill();
    }
    pen.stroke();
  }

  force(h, force) {
    const { pen, scale, x0, y0 } = this;
    const length = (force / this.strongest) * 0.5 * scale, side = Math.sign(length);
    if (Math.abs(length) < 2) return;
    const from = x0 + h * scale + side * (0.13 * scale + 3), to = from + length, head = Math.min(7, Math.abs(length));
    pen.strokeStyle = pen.fillStyle = colour("--ink");
    pen.setLineDash([]);
    pen.lineWidth = 3;
    pen.beginPath();
    pen.moveTo(from, y0);
    pen.lineTo(to - side * head, y0);
    pen.stroke();
    pen.beginPath();
    pen.moveTo(to, y0);
    pen.lineTo(to - side * head, y0 - 0.7 * head);
    pen.lineTo(to - side * head, y0 + 0.7 * head);
    pen.fill();
  }
}
