// A small WebGL2 renderer: dynamic meshes, one shadow map, any number of panes side by side in one canvas.

const SHADOW_SIZE = 2048;
const VIRIDIS = '440154 481a6c 472f7d 414487 39568c 31688e 2a788e 23888e ' +
    '1f988b 22a884 35b779 54c568 7ad151 a5db36 d2e21b fde725';

const KEY_LIGHT = normalize([0.45, 0.82, 0.62]);

class Renderer {
  constructor(canvas) {
    const gl = canvas.getContext('webgl2', {antialias: true, preserveDrawingBuffer: true});
    if (!gl) throw new Error('This browser has no WebGL2; the table and the plots below work without it.');
    this.gl = gl;
    this.canvas = canvas;
    this.mesh = this.program(MESH_VERTEX, MESH_FRAGMENT);
    this.ground = this.program(GROUND_VERTEX, GROUND_FRAGMENT);
    this.depth = this.program(DEPTH_VERTEX, DEPTH_FRAGMENT);
    this.createShadowMap();
    this.createColorMap();
    this.white = this.createPicture(null);
    gl.vertexAttrib3f(3, 1, 1, 1);  // what meshes without colours of their own are painted with
    this.quad = gl.createVertexArray();
    gl.bindVertexArray(this.quad);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  }

  program(vertex, fragment) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const name = gl.getActiveUniform(program, i).name;
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return {program, uniforms};
  }

  createShadowMap() {
    const gl = this.gl;
    this.shadow = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.shadow);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW_SIZE, SHADOW_SIZE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    this.shadowTarget = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTarget);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.shadow, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  createColorMap() {
    const gl = this.gl;
    const bytes = VIRIDIS.split(' ').flatMap((hex) =>
        [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)).concat(255));
    this.colorMap = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.colorMap);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, bytes.length / 4, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(bytes));
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  }

  // One pixel of white without a picture.
  createPicture(picture) {
    const gl = this.gl;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    if (picture) gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4).fill(255));
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    return texture;
  }

  // A mesh whose vertices change every frame; `faces` and `colours` (three linear floats a vertex) do not. `look` has
  // the parts that differ and where vertices lie in their pictures.
  createMesh(count, faces, colours = null, look = null) {
    const gl = this.gl;
    const mesh = {
      positions: new Float32Array(count * 3), normals: new Float32Array(count * 3),
      scalars: new Float32Array(count * 2),
      faces, buffers: [], vao: gl.createVertexArray(),
      type: faces instanceof Uint16Array ? gl.UNSIGNED_SHORT : gl.UNSIGNED_INT,
    };
    gl.bindVertexArray(mesh.vao);
    [mesh.positions, mesh.normals, mesh.scalars].forEach((data, i) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data.byteLength, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, i < 2 ? 3 : 2, gl.FLOAT, false, 0, 0);
      mesh.buffers.push(buffer);
    });
    if (colours) {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, colours, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(3);
      gl.vertexAttribPointer(3, 3, gl.FLOAT, false, 0, 0);
    }
    if (look && look.textureCoordinates) {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, look.textureCoordinates, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(4);
      gl.vertexAttribPointer(4, 2, gl.FLOAT, false, 0, 0);
      const textures = new Map();
      mesh.parts = look.parts.map((part) => {
        if (part.picture && !textures.has(part.picture)) textures.set(part.picture, this.createPicture(part.picture));
        return {...part, texture: part.picture ? textures.get(part.picture) : this.white};
      });
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return mesh;
  }

  upload(mesh) {
    const gl = this.gl;
    [mesh.positions, mesh.normals, mesh.scalars].forEach((data, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[i]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, data);
    });
  }

  // Matches the drawing buffer to the canvas's size on screen.
  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
  }

  // panes: [{x, width (fractions of the canvas), meshes: [{mesh, material, outer, inner}]}]
  draw(panes, camera, focus, groundY, theme, errorScale) {
    const gl = this.gl;
    this.resize();
    const eyeLight = add(focus, KEY_LIGHT, 4);
    const light = multiply(orthographic(1.7, 0.5, 8), lookAt(eyeLight, focus, [0, 1, 0]));
    gl.enable(gl.DEPTH_TEST);
    for (const pane of panes) {
      this.drawShadow(pane.meshes, light);
      const x = Math.round(pane.x * this.canvas.width);
      const width = Math.round(pane.width * this.canvas.width);
      gl.viewport(x, 0, width, this.canvas.height);
      gl.scissor(x, 0, width, this.canvas.height);
      gl.enable(gl.SCISSOR_TEST);
      gl.clearColor(...theme.background, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      const {eye, matrix} = camera.matrices(width / this.canvas.height);
      this.drawGround(matrix, light, [focus[0], groundY, focus[2]], theme);
      this.drawMeshes(pane.meshes, matrix, light, eye, theme, errorScale);
      gl.disable(gl.SCISSOR_TEST);
    }
  }

  drawShadow(meshes, light) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTarget);
    gl.viewport(0, 0, SHADOW_SIZE, SHADOW_SIZE);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.depth.program);
    gl.uniformMatrix4fv(this.depth.uniforms.light_projection, false, light);
    for (const {mesh} of meshes) {
      gl.bindVertexArray(mesh.vao);
      gl.drawElements(gl.TRIANGLES, mesh.faces.length, mesh.type, 0);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  bindCommon(uniforms, matrix, light, theme) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.shadow);
    gl.uniform1i(uniforms.shadow_map, 0);
    gl.uniform1f(uniforms.shadow_texel, 1 / SHADOW_SIZE);
    gl.uniformMatrix4fv(uniforms.view_projection, false, matrix);
    gl.uniformMatrix4fv(uniforms.light_projection, false, light);
    gl.uniform3fv(uniforms.background, theme.background);
  }

  drawGround(matrix, light, center, theme) {
    const gl = this.gl;
    const {program, uniforms} = this.ground;
    gl.useProgram(program);
    this.bindCommon(uniforms, matrix, light, theme);
    gl.uniform3fv(uniforms.center, center);
    gl.uniform3fv(uniforms.pool, theme.pool);
    gl.uniform1f(uniforms.line, 1);
    gl.bindVertexArray(this.quad);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  drawMeshes(meshes, matrix, light, eye, theme, errorScale) {
    const gl = this.gl;
    const {program, uniforms} = this.mesh;
    gl.useProgram(program);
    this.bindCommon(uniforms, matrix, light, theme);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.colorMap);
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1i(uniforms.color_map, 1);
    gl.uniform1i(uniforms.picture, 2);
    gl.activeTexture(gl.TEXTURE2);
    gl.uniform3fv(uniforms.eye, eye);
    gl.uniform1f(uniforms.error_scale, errorScale);
    for (const {mesh, material, outer, inner} of meshes) {
      gl.uniform1i(uniforms.material, material);
      gl.uniform3fv(uniforms.outer_color, outer);
      gl.uniform3fv(uniforms.inner_color, inner);
      gl.bindVertexArray(mesh.vao);
      const plain = {first: 0, count: mesh.faces.length, texture: this.white};
      for (const part of mesh.parts || [plain]) {
        gl.bindTexture(gl.TEXTURE_2D, part.texture);
        // A material without a picture that says nothing of its colour is as grey as a body without materials.
        if (part.colour) gl.uniform3fv(uniforms.outer_color, part.picture ? part.colour : shade(part.colour, outer));
        gl.uniform1f(uniforms.least_alpha, part.cut_out ? 0.4 : 0);
        gl.drawElements(gl.TRIANGLES, part.count, mesh.type, part.first * mesh.faces.BYTES_PER_ELEMENT);
      }
    }
    gl.activeTexture(gl.TEXTURE0);
  }
}

function shade(colour, grey) {
  return colour.every((c) => c > 0.99) ? grey : colour;
}
