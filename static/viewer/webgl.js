// What draws in three dimensions here: a "card", or the processor ("software"); "" where nothing can. Looked for once.
let webgl;
export function hasWebGL() {
  if (webgl === undefined) {
    const gl = document.createElement("canvas").getContext("webgl2");
    const info = gl?.getExtension("WEBGL_debug_renderer_info");
    const isSoftware = /swiftshader|llvmpipe|software|basic render/i.test(String(info && gl.getParameter(info.UNMASKED_RENDERER_WEBGL)));
    webgl = gl ? (isSoftware ? "software" : "card") : "";
    gl?.getExtension("WEBGL_lose_context")?.loseContext();
  }
  return webgl;
}
