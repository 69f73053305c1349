// Points in colour by the browser's own WebGL: a million stand still, every k-th moves while a hand turns them.
// Views are orthographic, so that lengths can be compared; a line or a plane is seen from the front.
const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
const VERTEX = `#version 300 es
in float x, y, z, value;
uniform vec3 centre, scale; uniform vec2 range; uniform mat3 turn; uniform float size; uniform sampler2D colours;
flat out vec3 colour;
void main() {
  vec3 place = (turn * (vec3(x, y, z) - centre)) * scale;
  gl_Position = vec4(place.xy, -place.z, 1.0); gl_PointSize = size;
  float share = clamp((value - range.x) / (range.y - range.x), 0.0, 1.0);
  colour = isnan(value) || isinf(value) ? vec3(0.6) : textureLod(colours, vec2(share, 0.5), 0.0).rgb;
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
flat in vec3 colour; uniform bool round; out vec4 pixel;
void main() {
  if (round && distance(gl_PointCoord, vec2(0.5)) > 0.5) discard;
  pixel = vec4(colour, 1.0);
}`;
const short = value => String(Number(value.toPrecision(4)));
function ticks(low, high, most) {
  const rough = (high - low) / most, ten = 10 ** Math.floor(Math.log10(rough));
  const step = ten * [1, 2, 5, 10].find(factor => factor * ten >= rough), found = [];
  if (!(step > 0)) return [];
  for (let k = Math.ceil(low / step); k * step <= high && found.length < 50; k++) found.push(k * step);
  return found;
}
class PointView {
  constructor(place) {
    this.place = place; this.n = 0; this.every = 1; this.held = new Map(); this.touched = false;
    this.yaw = -0.6; this.pitch = 0.45;
    [this.below, this.above] = ["", ""].map(() => {
      const made = document.createElement("canvas");
      made.style.cssText = "position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none";
      place.appendChild(made); return made;
    });
    place.style.position = "relative"; this.above.style.cursor = "move";
    this.above.title = "drag: turn or shift, wheel or two fingers: nearer, double click: all";
    this.pen = this.above.getContext("2d");
    const gl = this.gl = this.below.getContext("webgl2", { antialias: false });
    if (!gl) { place.textContent = "Points need WebGL 2, which this browser does not offer."; return; }
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind); gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    gl.linkProgram(program); gl.useProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    this.buffers = ["x", "y", "z", "value"].map(name => ({ at: gl.getAttribLocation(program, name), made: gl.createBuffer() }));
    this.of = name => gl.getUniformLocation(program, name);
    const bar = document.createElement("canvas"); bar.width = 256; bar.height = 1;
    const paint = bar.getContext("2d"); paint.fillStyle = this.gradient(paint, 0, 256, 0, 0); paint.fillRect(0, 0, 256, 1);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, bar);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.enable(gl.DEPTH_TEST); gl.enable(gl.SCISSOR_TEST); gl.clearColor(1, 1, 1, 1);
    new ResizeObserver(() => { if (!this.touched) this.fit(); this.ask(); }).observe(place);
    this.above.addEventListener("pointerdown", event => { this.above.setPointerCapture(event.pointerId); this.held.set(event.pointerId, event); });
    for (const end of ["pointerup", "pointercancel"]) this.above.addEventListener(end, event => this.held.delete(event.pointerId));
    this.above.addEventListener("pointermove", event => this.drag(event));
    this.above.addEventListener("wheel", event => {
      event.preventDefault(); this.nearer(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY);
    }, { passive: false });
    this.above.addEventListener("dblclick", () => { this.touched = false; this.yaw = -0.6; this.pitch = 0.45; this.fit(); this.ask(); });
  }
  gradient(pen, x0, x1, y0, y1) {
    const made = pen.createLinearGradient(x0, y0, x1, y1);
    VIRIDIS.forEach((colour, k) => made.addColorStop(k / (VIRIDIS.length - 1), colour)); return made;
  }
  // Take a state: dimension d, positions and values (n,), the range of the colours and its name.
  show(d, positions, values, range, name) {
    if (!this.gl) return;
    const gl = this.gl, anew = d !== this.d || (d === 1 && name !== this.name);
    Object.assign(this, { d, range, name, n: values.length });
    const along = d === 1 ? [positions[0], values] : positions;
    this.buffers.forEach(({ at, made }, k) => {
      const numbers = k === 3 ? values : along[k];
      if (!numbers) { gl.disableVertexAttribArray(at); gl.vertexAttrib1f(at, 0); return; }
      gl.enableVertexAttribArray(at); gl.bindBuffer(gl.ARRAY_BUFFER, made); gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    });
    if (anew) { this.low = [Infinity, Infinity, Infinity]; this.high = [-Infinity, -Infinity, -Infinity]; this.touched = false; }
    const [low, high] = [this.low, this.high];
    for (let k = 0; k < 3; k++) {
      if (!along[k]) { low[k] = high[k] = 0; continue; }
      for (const at of along[k]) if (Number.isFinite(at)) { if (at < low[k]) low[k] = at; if (at > high[k]) high[k] = at; }
      if (low[k] > high[k]) low[k] = high[k] = 0;
    }
    if (!this.touched) this.fit();
    this.ask();
  }
  // The part of the element that points have, in pixels of the page.
  get inner() {
    const { clientWidth: w, clientHeight: h } = this.place, flat = this.d < 3;
    return { left: flat ? 62 : 4, top: 10, width: Math.max(20, w - (flat ? 62 : 4) - 92), height: Math.max(20, h - 10 - (flat ? 42 : 4)) };
  }
  fit() {
    if (!this.low) return;
    const { width, height } = this.inner, span = this.low.map((low, k) => this.high[k] - low);
    this.centre = this.low.map((low, k) => (low + this.high[k]) / 2);
    this.across = Math.hypot(...span) || 1;
    if (this.d === 3) { this.unit = [0, 0].fill(0.95 * Math.min(width, height) / this.across); return; }
    const sides = [width / (span[0] || this.across), height / (span[1] || this.across)].map(side => 0.9 * side);
    this.unit = this.d === 1 ? sides : [0, 0].fill(Math.min(...sides));
  }
  get turn() {  // rows: to the right, upwards, to the eye
    if (this.d < 3) return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    const [c, s, e, f] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    return [[c, -s, 0], [s * f, c * f, e], [-s * e, -c * e, f]];
  }
  drag(event) {
    const before = this.held.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    const others = [...this.held.values()].filter(other => other.pointerId !== event.pointerId);
    if (others.length) {
      const far = from => Math.hypot(from.clientX - others[0].clientX, from.clientY - others[0].clientY);
      this.nearer(far(event) / Math.max(far(before), 1), (event.offsetX + others[0].offsetX) / 2, (event.offsetY + others[0].offsetY) / 2);
    }
    if (this.d === 3 && !others.length && !event.shiftKey) {
      this.yaw += dx / 150; this.pitch = Math.max(-1.57, Math.min(1.57, this.pitch + dy / 150));
    } else this.shift(dx / (others.length ? 2 : 1), dy / (others.length ? 2 : 1));
    this.held.set(event.pointerId, event); this.touched = true; this.move();
  }
  shift(dx, dy) {
    const [right, up] = this.turn;
    this.centre = this.centre.map((at, k) => at - right[k] * dx / this.unit[0] + up[k] * dy / this.unit[1]);
  }
  nearer(factor, x, y) {
    const { left, top, width, height } = this.inner, [dx, dy] = [x - left - width / 2, y - top - height / 2];
    this.shift(-dx, -dy); this.unit = this.unit.map(unit => unit * factor); this.shift(dx, dy);
    this.touched = true; this.move();
  }
  move() { this.moving = true; clearTimeout(this.rest); this.rest = setTimeout(() => { this.moving = false; this.ask(); }, 250); this.ask(); }
  ask() { if (!this.asked) this.asked = requestAnimationFrame(now => { this.asked = null; this.draw(now); }); }
  draw(now) {
    if (!this.n || !this.unit) return;
    const gl = this.gl, { left, top, width, height } = this.inner, dense = window.devicePixelRatio || 1;
    const [w, h] = [this.place.clientWidth, this.place.clientHeight].map(side => Math.round(side * dense));
    for (const made of [this.below, this.above]) if (made.width !== w || made.height !== h) { made.width = w; made.height = h; }
    // Fewer points while they are turned, where all would take longer than a picture may.
    if (this.moving && this.drawn) {
      if (now - this.drawn > 80 && this.every < 64) this.every *= 2;
      else if (now - this.drawn < 25 && this.every > 1) this.every /= 2;
    }
    this.drawn = this.moving ? now : 0;
    const every = this.moving ? this.every : 1, count = Math.ceil(this.n / every);
    const box = [left, this.place.clientHeight - top - height, width, height].map(side => Math.round(side * dense));
    gl.viewport(...box); gl.scissor(...box); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.buffers.forEach(({ at, made }, k) => {
      if (!gl.getVertexAttrib(at, gl.VERTEX_ATTRIB_ARRAY_ENABLED)) return;
      gl.bindBuffer(gl.ARRAY_BUFFER, made); gl.vertexAttribPointer(at, 1, gl.FLOAT, false, 4 * every, 0);
    });
    const rows = this.turn, span = this.low.map((low, k) => Math.max(this.high[k] - low, 1e-6 * this.across));
    gl.uniformMatrix3fv(this.of("turn"), true, rows.flat());
    gl.uniform3fv(this.of("centre"), this.centre);
    gl.uniform3f(this.of("scale"), 2 * this.unit[0] / width, 2 * this.unit[1] / height, 0.9 / this.across);
    gl.uniform2f(this.of("range"), ...this.range);
    const near = this.d === 1 ? 6 : this.unit[0] * (this.d === 3 ? Math.cbrt(span[0] * span[1] * span[2] / count) : Math.sqrt(span[0] * span[1] / count));
    const size = Math.max(1, Math.min(24, 1.1 * near)) * dense;
    gl.uniform1f(this.of("size"), size); gl.uniform1i(this.of("round"), size > 3 ? 1 : 0);
    gl.drawArrays(gl.POINTS, 0, count);
    this.write(dense, left, top, width, height, rows);
  }
  // Axes, or the box around all points in space, and the bar of the colours.
  write(dense, left, top, width, height, rows) {
    const pen = this.pen, right = left + width + 14;
    pen.setTransform(dense, 0, 0, dense, 0, 0); pen.clearRect(0, 0, this.place.clientWidth, this.place.clientHeight);
    pen.font = "12px system-ui, sans-serif"; pen.strokeStyle = "#9aa3ab"; pen.fillStyle = "#1d2329"; pen.lineWidth = 1;
    const text = (words, x, y, align = "left", base = "middle") => { pen.textAlign = align; pen.textBaseline = base; pen.save(); pen.strokeStyle = "#fff"; pen.lineWidth = 3; pen.strokeText(words, x, y); pen.restore(); pen.fillText(words, x, y); };
    const line = (...ends) => { pen.beginPath(); pen.moveTo(...ends[0]); pen.lineTo(...ends[1]); pen.stroke(); };
    const at = place => {
      const from = place.map((x, k) => x - this.centre[k]), along = row => row.reduce((sum, r, k) => sum + r * from[k], 0);
      return [left + width / 2 + this.unit[0] * along(rows[0]), top + height / 2 - this.unit[1] * along(rows[1])];
    };
    if (this.d < 3) {
      pen.strokeRect(left, top, width, height);
      const ends = [0, 1].map(k => [-1, 1].map(side => this.centre[k] + side * [width, height][k] / 2 / this.unit[k]));
      for (const x of ticks(...ends[0], width / 70)) { const [px] = at([x, 0, 0]); line([px, top + height], [px, top + height + 4]); text(short(x), px, top + height + 14, "center"); }
      for (const y of ticks(...ends[1], height / 45)) { const [, py] = at([0, y, 0]); line([left - 4, py], [left, py]); text(short(y), left - 7, py, "right"); }
      text("x", left + width / 2, top + height + 32, "center"); text(this.d > 1 ? "y" : this.name, 4, top + 6);
    } else {
      const corner = bits => at(bits.map((bit, k) => bit ? this.high[k] : this.low[k]));
      for (let k = 0; k < 3; k++) {
        const edges = [[0, 0], [0, 1], [1, 0], [1, 1]].map(bits => [0, 1].map(bit => corner([...bits.slice(0, k), bit, ...bits.slice(k)])));
        for (const edge of edges) line(...edge);
        // What stands outside hides no points: x and y at the lowest of their edges, z at the one most to the left.
        const [px, py] = edges.map(([a, b]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]).sort((a, b) => k < 2 ? b[1] - a[1] : a[0] - b[0])[0];
        const [low, high] = [this.low[k], this.high[k]].map(value => short(Number(value.toFixed(Math.max(0, Math.min(100, 4 - Math.ceil(Math.log10(this.across))))))));
        const words = `${"xyz"[k]}: ${low} … ${high}`, half = pen.measureText(words).width / 2 + 2;
        text(words, Math.max(half, Math.min(left + width - half, k < 2 ? px : px - half - 4)), Math.min(top + height - 8, py + (k < 2 ? 14 : 0)), "center");
      }
    }
    const long = Math.min(height - 40, 320), from = top + 26;
    text(this.name, right, top + 8); pen.fillStyle = this.gradient(pen, 0, 0, from + long, from); pen.fillRect(right, from, 14, long);
    pen.fillStyle = "#1d2329";
    for (const value of ticks(...this.range, long / 45)) text(short(value), right + 19, from + long * (1 - (value - this.range[0]) / (this.range[1] - this.range[0])));
  }
}
