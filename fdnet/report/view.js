// The 3-D view of report.html: spheres as lit discs with true depth, WebGL 2, no library.
"use strict";
(() => {
  const place = document.getElementById("view");
  const model = JSON.parse(document.getElementById("view-data").textContent);
  const canvas = place.querySelector("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return;

  // --- data: x, y, z, radius in mm, centred on the box
  const raw = Uint8Array.from(atob(model.data), (c) => c.charCodeAt(0));
  const steps = new Uint16Array(raw.buffer), count = model.spheres;
  const middle = model.box.map(([a, b]) => (a + b) / 2);
  const half = Math.hypot(...model.box.map(([a, b]) => (b - a) / 2));
  const spheres = new Float32Array(5 * count), depths = [];
  const from = [Infinity, Infinity], to = [-Infinity, -Infinity];
  for (let i = 0; i < count; i++) {
    const at = [0, 1, 2].map((k) =>
      model.low[k] + steps[4 * i + k] / 65535 * (model.high[k] - model.low[k]));
    const radius = steps[4 * i + 3] / 65535 * model.radius;
    for (let k = 0; k < 3; k++) spheres[5 * i + k] = at[k] - middle[k];
    spheres[5 * i + 3] = radius;
    spheres[5 * i + 4] = i < model.grains ? 0 : 1;
    if (i >= model.grains) {
      depths.push(Math.max(at[0], 0));
      [Math.max(at[0], 0), radius].forEach((value, k) => {
        from[k] = Math.min(from[k], value);
        to[k] = Math.max(to[k], value);
      });
    }
  }

  depths.sort((a, b) => a - b);
  if (depths.length) to[0] = depths[Math.floor(0.97 * (depths.length - 1))];

  // --- programs
  const program = (vertex, fragment) => {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, "#version 300 es\nprecision highp float;\n" + text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    return gl.getProgramParameter(made, gl.LINK_STATUS) ? made : null;
  };
  const balls = program(`
    in vec2 corner; in vec4 sphere; in float kind;
    uniform mat3 turn; uniform vec2 zoom; uniform float reach, near, colour, shownFrom;
    uniform vec2 first, last; uniform float face;
    out vec2 at; out float depth, size; out vec3 tint;
    vec3 plasma(float t) {
      vec3 a = mix(vec3(.05, .03, .53), vec3(.62, .10, .62), smoothstep(0., .35, t));
      vec3 b = mix(a, vec3(.93, .47, .33), smoothstep(.35, .7, t));
      return mix(b, vec3(.94, .90, .13), smoothstep(.7, 1., t));
    }
    void main() {
      vec3 p = turn * sphere.xyz;
      at = corner; depth = p.z; size = sphere.w;
      vec2 value = vec2(sphere.x + face, sphere.w);
      vec2 t = clamp((value - first) / max(last - first, vec2(1e-9)), 0., 1.);
      tint = kind < .5 ? vec3(.86) : plasma(colour < .5 ? t.x : t.y);
      bool hidden = kind < .5 && sphere.y < shownFrom;
      gl_Position = hidden ? vec4(2., 2., 2., 1.)
        : vec4((p.xy + corner * sphere.w) * zoom, -p.z / reach, 1.);
    }`, `
    in vec2 at; in float depth, size; in vec3 tint; uniform float reach; out vec4 paint;
    void main() {
      float d = dot(at, at);
      if (d > 1.) discard;
      vec3 normal = vec3(at, sqrt(1. - d));
      float light = .38 + .62 * max(dot(normal, normalize(vec3(-.35, .5, .8))), 0.);
      gl_FragDepth = .5 - .5 * (depth + normal.z * size) / reach;
      paint = vec4(tint * light * (.82 + .18 * normal.z), 1.);
    }`);
  const lines = program(`
    in vec3 point; uniform mat3 turn; uniform vec2 zoom; uniform float reach;
    void main() { vec3 p = turn * point; gl_Position = vec4(p.xy * zoom, -p.z / reach, 1.); }`, `
    uniform vec3 ink; out vec4 paint; void main() { paint = vec4(ink, 1.); }`);
  if (!balls || !lines) return;

  const buffer = (data) => {
    const made = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(data), gl.STATIC_DRAW);
    return made;
  };
  const attach = (made, name, size, stride, offset, each) => {
    const where = gl.getAttribLocation(made, name);
    gl.enableVertexAttribArray(where);
    gl.vertexAttribPointer(where, size, gl.FLOAT, false, 4 * stride, 4 * offset);
    gl.vertexAttribDivisor(where, each);
  };
  const ballArrays = gl.createVertexArray();
  gl.bindVertexArray(ballArrays);
  buffer([-1, -1, 1, -1, -1, 1, 1, 1]);
  attach(balls, "corner", 2, 2, 0, 0);
  buffer(spheres);
  attach(balls, "sphere", 4, 5, 0, 1);
  attach(balls, "kind", 1, 5, 4, 1);

  const side = model.box.map(([a, b]) => (b - a) / 2);
  const ends = [];
  for (let axis = 0; axis < 3; axis++)
    for (const a of [-1, 1]) for (const b of [-1, 1]) for (const c of [-1, 1]) {
      const point = [0, 0, 0];
      point[axis] = c * side[axis];
      point[(axis + 1) % 3] = a * side[(axis + 1) % 3];
      point[(axis + 2) % 3] = b * side[(axis + 2) % 3];
      ends.push(point);
    }
  const onFace = (p) => p[0] < 0;
  const pairs = [];
  for (let i = 0; i < ends.length; i += 2) pairs.push([ends[i], ends[i + 1]]);
  pairs.sort((p, q) => (p.every(onFace) ? 1 : 0) - (q.every(onFace) ? 1 : 0));
  const faceFrom = 2 * pairs.filter((p) => !p.every(onFace)).length;
  const lineArrays = gl.createVertexArray();
  gl.bindVertexArray(lineArrays);
  buffer(pairs.flat(2));
  attach(lines, "point", 3, 3, 0, 0);

  // --- state and drawing
  const start = { yaw: 0.55, pitch: 0.42, scale: 1 };
  const state = { ...start, colour: model.one_size ? 0 : 1, shown: 0.5 };
  const label = place.querySelector(".face-label");
  const matrix = () => {
    const [c, s] = [Math.cos(state.yaw), Math.sin(state.yaw)];
    const [e, f] = [Math.cos(state.pitch), Math.sin(state.pitch)];
    // x to the right, y into the screen, z up; then turned by yaw about z and tipped by pitch
    const x = [c, f * s, -e * s], y = [-s, f * c, -e * c], z = [0, e, f];
    return new Float32Array([...x, ...y, ...z]);
  };
  const draw = () => {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = Math.max(1, Math.round(width * ratio));
    canvas.height = Math.max(1, Math.round(height * ratio));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(1, 1, 1, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const fit = Math.max(spread[0] / (width / height), spread[1]) * 1.12 / state.scale;
    const zoom = [height / width / fit, 1 / fit], turn = matrix(), reach = 4 * half;
    const set = (made) => {
      gl.useProgram(made);
      gl.uniformMatrix3fv(gl.getUniformLocation(made, "turn"), false, turn);
      gl.uniform2fv(gl.getUniformLocation(made, "zoom"), zoom);
      gl.uniform1f(gl.getUniformLocation(made, "reach"), reach);
      return (name) => gl.getUniformLocation(made, name);
    };
    let where = set(balls);
    const [ya, yb] = model.box[1];
    gl.uniform1f(where("colour"), state.colour);
    gl.uniform1f(where("shownFrom"), state.shown >= 1 ? -1e9
      : state.shown <= 0 ? 1e9 : (0.5 - state.shown) * (yb - ya));
    gl.uniform2fv(where("first"), from);
    gl.uniform2fv(where("last"), to);
    gl.uniform1f(where("face"), middle[0] - model.box[0][0]);
    gl.bindVertexArray(ballArrays);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    where = set(lines);
    gl.bindVertexArray(lineArrays);
    gl.uniform3f(where("ink"), 0.35, 0.35, 0.35);
    gl.drawArrays(gl.LINES, 0, faceFrom);
    gl.uniform3f(where("ink"), 0, 0.447, 0.698);
    gl.drawArrays(gl.LINES, faceFrom, 24 - faceFrom);
    const p = [-side[0], 0, side[2]];
    const [u, v] = [0, 1].map((k) => (turn[k] * p[0] + turn[3 + k] * p[1] + turn[6 + k] * p[2]));
    const edge = label.offsetWidth / 2 + 4;
    const across = (0.5 + 0.5 * u * zoom[0]) * width;
    label.style.left = `${Math.max(edge, Math.min(width - edge, across))}px`;
    label.style.top = `${(0.5 - 0.5 * v * zoom[1]) * height}px`;
  };
  const first = matrix();
  const spread = [0, 1].map((k) => Math.max(...ends.map((p) =>
    Math.abs(first[k] * p[0] + first[3 + k] * p[1] + first[6 + k] * p[2]))));
  let asked = false;
  const later = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; draw(); });
  };

  // --- hands
  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const apart = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    const was = fingers.size === 2 ? apart() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 2) state.scale *= apart() / Math.max(was, 1);
    else {
      state.yaw += (event.clientX - before[0]) * 0.008;
      state.pitch = Math.max(-1.57, Math.min(1.57,
        state.pitch + (event.clientY - before[1]) * 0.008));
    }
    state.scale = Math.max(0.4, Math.min(12, state.scale));
    later();
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  const zoomBy = (factor) => {
    state.scale = Math.max(0.4, Math.min(12, state.scale * factor));
    later();
  };
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.shiftKey) return;
    event.preventDefault();
    zoomBy(Math.exp(-0.002 * (event.deltaY || event.deltaX)));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1],
                   ArrowDown: [0, 0.1] }[event.key];
    if (!step) return;
    event.preventDefault();
    state.yaw += step[0];
    state.pitch += step[1];
    later();
  });
  place.querySelector(".shown").addEventListener("input", (event) => {
    state.shown = event.target.value / 100;
    later();
  });
  const legend = place.querySelector(".legend-ends");
  const say = () => {
    const unit = state.colour ? (v) => `${(1e3 * v).toPrecision(3)} µm` : (v) =>
      `${v.toPrecision(3)} mm`;
    legend.textContent = count > model.grains
      ? `fines: ${unit(from[state.colour])} (dark) to ${unit(to[state.colour])}${state.colour ? "" : " and deeper"} (yellow)` : "";
  };
  const choice = place.querySelector(".colour");
  choice.value = String(state.colour);
  choice.addEventListener("change", () => { state.colour = Number(choice.value); say(); later(); });
  place.querySelector(".closer").addEventListener("click", () => zoomBy(1.25));
  place.querySelector(".further").addEventListener("click", () => zoomBy(0.8));
  place.querySelector(".reset").addEventListener("click", () => {
    Object.assign(state, start);
    later();
  });
  place.classList.add("live");
  say();
  draw();
  new ResizeObserver(later).observe(canvas);
})();
