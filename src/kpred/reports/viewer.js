"use strict";
for (const canvas of document.querySelectorAll(".view canvas")) show(canvas);

function show(canvas) {
  const gl = canvas.getContext("webgl2", {antialias: true});
  if (!gl) { canvas.replaceWith("This browser shows no 3D: it has no WebGL 2."); return; }
  const data = JSON.parse(document.getElementById(canvas.dataset.scene).textContent);
  const program = build(gl), at = name => gl.getUniformLocation(program, name);
  const [view, look, size, extent, single, lift] = ["view", "look", "size", "extent", "single", "lift"].map(at);
  const items = data.items.map(item => load(gl, item));
  const start = () => ({yaw: 0.55, pitch: 0.42, distance: 2.5, middle: [0, 0, 0]});
  let eye = start(), asked = false;

  const draw = () => {
    asked = false;
    canvas.width = canvas.clientWidth * devicePixelRatio; canvas.height = canvas.clientHeight * devicePixelRatio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.957, 0.965, 0.976, 1); gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(program);
    const [s, c, t, d] = [Math.sin(eye.yaw), Math.cos(eye.yaw), Math.sin(eye.pitch), Math.cos(eye.pitch)];
    gl.uniformMatrix3fv(view, false, [c, -s * t, s * d, 0, d, t, -s, -c * t, c * d]);
    gl.uniform4f(look, ...eye.middle, eye.distance);
    gl.uniform3f(extent, ...data.extent);
    const wide = canvas.width / canvas.height;
    gl.uniform2f(size, Math.min(1, 1 / wide) * 2.4, Math.min(wide, 1) * 2.4);
    for (const item of items) {
      if (!item.on) continue;
      gl.uniform1f(single, item.points ? item.size * devicePixelRatio : 0);
      gl.uniform1f(lift, item.points ? 0.004 : 0);
      gl.bindVertexArray(item.array);
      if (!item.colors) gl.vertexAttrib3f(1, ...item.color.map(value => value / 255));
      if (item.points) gl.drawArrays(gl.POINTS, 0, item.count);
      else gl.drawElements(gl.TRIANGLES, item.count, gl.UNSIGNED_INT, 0);
    }
  };
  const redraw = () => { if (!asked) { asked = true; requestAnimationFrame(draw); } };

  const held = new Map();
  canvas.addEventListener("pointerdown", event => { held.set(event.pointerId, event); canvas.setPointerCapture(event.pointerId); });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, event => held.delete(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const x = event.clientX - before.clientX, y = event.clientY - before.clientY;
    const other = [...held.values()].find(one => one.pointerId !== event.pointerId);
    if (other) {
      const apart = one => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY) || 1;
      zoom(apart(before) / apart(event));
    } else if (event.shiftKey || event.buttons & 6) {
      const step = eye.distance / canvas.clientHeight, [s, c] = [Math.sin(eye.yaw), Math.cos(eye.yaw)];
      eye.middle = [eye.middle[0] - c * x * step, eye.middle[1] + y * step, eye.middle[2] + s * x * step];
    } else {
      eye.yaw -= x * 0.008;
      eye.pitch = Math.min(1.57, Math.max(-1.57, eye.pitch + y * 0.008));
    }
    held.set(event.pointerId, event);
    redraw();
  });
  const zoom = factor => { eye.distance = Math.min(20, Math.max(0.1, eye.distance * factor)); redraw(); };
  canvas.addEventListener("wheel", event => { event.preventDefault(); zoom(Math.exp(event.deltaY * 0.001)); }, {passive: false});
  canvas.addEventListener("contextmenu", event => event.preventDefault());
  canvas.addEventListener("dblclick", () => { eye = start(); redraw(); });
  for (const button of document.querySelectorAll("button[data-focus]")) button.addEventListener("click", () => {
    const item = items[button.dataset.focus];
    eye = {...start(), middle: item.middle, distance: Math.max(0.3, 3 * item.radius)};
    canvas.scrollIntoView({block: "center"}); redraw();
  });

  const layers = canvas.parentElement.querySelector(".layers");
  for (const name of new Set(items.map(item => item.layer))) {
    const label = document.createElement("label"), box = document.createElement("input"), mark = document.createElement("i");
    const some = items.filter(item => item.layer === name);
    if (!some.some(item => item.count)) continue;
    box.type = "checkbox"; box.checked = some[0].on;
    box.addEventListener("change", () => { for (const item of some) item.on = box.checked; redraw(); });
    mark.style.background = some.length > 1 || some[0].colors ? "conic-gradient(#6f9fd8,#e28958,#7ab27a)" : `rgb(${some[0].color})`;
    label.append(box, mark, name); layers.append(label);
  }
  new ResizeObserver(redraw).observe(canvas);

  function load(gl, item) {
    const places = decode(item.vertices, Uint16Array), low = [1, 1, 1], high = [0, 0, 0];
    for (let i = 0; i < places.length; i++) {
      const value = places[i] / 65535;
      low[i % 3] = Math.min(low[i % 3], value); high[i % 3] = Math.max(high[i % 3], value);
    }
    const side = low.map((value, k) => (high[k] - value) * data.extent[k]);
    const result = {...item, array: gl.createVertexArray(), middle: low.map((value, k) => ((value + high[k]) / 2 - 0.5) * data.extent[k]), radius: Math.hypot(...side) / 2};
    gl.bindVertexArray(result.array);
    attribute(gl, 0, places, gl.UNSIGNED_SHORT);
    if (item.colors) attribute(gl, 1, decode(item.colors, Uint8Array), gl.UNSIGNED_BYTE);
    const faces = item.points ? null : decode(item.faces, Uint32Array);
    if (faces) { gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer()); gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW); }
    result.count = faces ? faces.length : places.length / 3;
    return result;
  }
}

function attribute(gl, place, values, type) {
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, 3, type, true, 0, 0);
}

function decode(text, Type) {
  const raw = atob(text), found = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) found[i] = raw.charCodeAt(i);
  return new Type(found.buffer);
}

function build(gl) {
  const program = gl.createProgram();
  const parts = [[gl.VERTEX_SHADER, `#version 300 es
    layout(location = 0) in vec3 place; layout(location = 1) in vec3 paint;
    uniform mat3 view; uniform vec4 look; uniform vec2 size; uniform vec3 extent; uniform float single, lift;
    out vec3 seen, color;
    void main() {
      seen = view * ((place - 0.5) * extent - look.xyz) - vec3(0, 0, look.w); color = paint;
      float near = 0.02, far = 40.0, depth = -seen.z;
      gl_Position = vec4(seen.xy * size, (depth * (far + near) - 2.0 * far * near) / (far - near) - lift, depth);
      gl_PointSize = clamp(single * 3.0 / max(depth, 0.01), 1.0, 14.0);
    }`], [gl.FRAGMENT_SHADER, `#version 300 es
    precision highp float; in vec3 seen, color; uniform float single; out vec4 result;
    void main() {
      if (single > 0.0) {
        vec2 from = 2.0 * gl_PointCoord - 1.0; if (dot(from, from) > 1.0) discard;
        result = vec4(color * (1.0 - 0.25 * dot(from, from)), 1); return;
      }
      vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
      float light = 0.42 + 0.42 * abs(dot(normal, normalize(vec3(-0.4, 0.75, 0.6)))) + 0.2 * abs(normal.z);
      result = vec4(color * light, 1);
    }`]];
  for (const [kind, text] of parts) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}
