// What packing.js and player.js use of two libraries; libraries.min.js is made of this, as its first
// lines say.
export {
  BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, FloatType, Mesh,
  PerspectiveCamera, Points, Scene, ShaderMaterial, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { default as uPlot } from "uplot";
