// The picture: renderer, camera, and the loop that draws when there is something new.

import { type Color, PerspectiveCamera, Scene, Vector2, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { applyTheme } from "./light.ts";
import type { Ray } from "./ray.ts";

/** After so long without movement [ms] a still picture is drawn as finely as the screen can show it. */
const STILL = 250;
/** Frames longer than the first [ms] make the picture coarser, shorter than the second finer. */
const [SLOW, FAST] = [30, 17.5];
/** The camera comes as close as so many cells. */
const CLOSEST = 30;
/** The camera stays so far above the surface, as a part of the way to what it looks at. */
const CLEARANCE = 0.1;
/** Coarsest resolution, as a part of the screen's. */
const COARSEST = 0.5;

/** What is drawn. */
export interface Play {
  /** Moves everything to where it is after so many milliseconds; true where it has to be called again. */
  advance(milliseconds: number): boolean;
  /** Whether the next frame is drawn as finely as can be, or quickly. */
  refine(fine: boolean): void;
}

/** Draws when there is something new; on slow machines moving pictures coarsely, and still ones finely. */
export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(38, 1, 0.1, 4000);
  readonly controls: OrbitControls;
  readonly canvas: HTMLCanvasElement;
  private readonly renderer: WebGLRenderer;
  private readonly play: Play;
  private readonly resizing: ResizeObserver;
  private readonly darkness = matchMedia("(prefers-color-scheme: dark)");
  private fresh = true;
  private covered = 0;
  private resolution = 1;
  private before = 0;
  private frameTime = 16;
  private running = 0;
  private lastDrawn = 0;
  private refined = true;
  /** The middle of the block, and how far away all of it is in view [m]. */
  private block = { middle: 0, distance: 1 };
  private frames = 0;

  constructor(canvas: HTMLCanvasElement, play: Play) {
    this.canvas = canvas;
    this.play = play;
    this.renderer = new WebGLRenderer({ canvas, context: opaqueContext(canvas) });
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.maxPolarAngle = 0.49 * Math.PI;
    this.controls.screenSpacePanning = false;
    this.controls.addEventListener("change", () => this.redraw());
    this.darkness.addEventListener("change", this.theme);
    this.theme();
    this.resizing = new ResizeObserver(() => this.resize());
    this.resizing.observe(canvas.parentElement ?? canvas);
    this.running = requestAnimationFrame(this.frame);
  }

  /** Frames drawn so far. */
  get drawn(): number {
    return this.frames;
  }

  /** Has the next frame drawn. */
  redraw(): void {
    this.fresh = true;
  }

  /** Looks at a block from the front, above the left corner: all of it in view. Its cells [m] can be seen from close by. */
  frameBlock(size: Vector3, cell: number): void {
    const middle = new Vector3(size.x / 2, size.y / 2, size.z / 2);
    const radius = size.length() / 2;
    const narrow = Math.min(1, this.camera.aspect);
    const distance = (radius / Math.sin((this.camera.fov * Math.PI) / 360) / narrow) * 1.06;
    this.controls.target.copy(middle);
    this.controls.minDistance = Math.min(0.15 * radius, CLOSEST * cell);
    this.controls.maxDistance = 4 * distance;
    this.block = { middle: middle.y, distance };
    this.camera.position.copy(middle).addScaledVector(new Vector3(0.48, 0.5, 0.82).normalize(), distance);
    this.setDepths();
    this.controls.update();
    this.redraw();
  }

  /**
   * From afar the picture is about the block's middle, the closer the more about the surface there. The camera stays above the
   * surface. `surfaceAt` tells its elevation [m] at a place; null beside the block.
   */
  aim(surfaceAt: (x: number, z: number) => number | null): void {
    const { middle, distance } = this.block;
    const { target } = this.controls;
    const { position } = this.camera;
    const away = position.distanceTo(target);
    const surface = surfaceAt(target.x, target.z) ?? middle;
    const rise = surface + Math.min(1, away / distance) * (middle - surface) - target.y;
    target.y += rise;
    position.y = Math.max(position.y + rise, (surfaceAt(position.x, position.z) ?? 0) + CLEARANCE * away);
    this.setDepths();
  }

  /** Comes as close as a distance [m], or stays where it is closer. */
  approach(distance: number): void {
    this.turn(0, 0, Math.min(1, distance / this.camera.position.distanceTo(this.controls.target)));
  }

  /** Draws from close before the camera to behind the block. */
  private setDepths(): void {
    this.camera.near = this.camera.position.distanceTo(this.controls.target) / 100;
    this.camera.far = this.block.distance * 10;
    this.camera.updateProjectionMatrix();
  }

  /** Shows everything beside what covers so much of the left side [px]. */
  keepLeftFree(width: number): void {
    this.covered = width;
    this.resize();
  }

  /** Turns the camera around what it looks at [rad], and goes closer by a factor. */
  turn(around: number, up: number, closer = 1): void {
    const way = this.camera.position.clone().sub(this.controls.target);
    const length = Math.min(Math.max(way.length() * closer, this.controls.minDistance), this.controls.maxDistance);
    const polar = Math.min(Math.max(Math.acos(way.y / way.length()) + up, 0.05), this.controls.maxPolarAngle);
    const angle = Math.atan2(way.x, way.z) + around;
    way.set(Math.sin(polar) * Math.sin(angle), Math.cos(polar), Math.sin(polar) * Math.cos(angle));
    this.camera.position.copy(this.controls.target).addScaledVector(way, length);
    this.controls.update();
  }

  /** The ray through a point of the window. */
  rayAt(clientX: number, clientY: number): Ray {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const point = new Vector2(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2);
    const origin = this.camera.position;
    const direction = new Vector3(point.x, point.y, 0.5).unproject(this.camera).sub(origin).normalize();
    return { origin: [origin.x, origin.y, origin.z], direction: [direction.x, direction.y, direction.z] };
  }

  close(): void {
    cancelAnimationFrame(this.running);
    this.resizing.disconnect();
    this.darkness.removeEventListener("change", this.theme);
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  private readonly theme = (): void => {
    this.scene.background = applyTheme(this.darkness.matches) satisfies Color;
    this.redraw();
  };

  private readonly frame = (now: number): void => {
    this.running = requestAnimationFrame(this.frame);
    const passed = Math.min(200, now - this.before);
    this.before = now;
    const moving = this.play.advance(passed);
    this.controls.update();
    if (moving || this.fresh) {
      this.adapt(now, passed);
      this.draw(this.resolution);
      this.lastDrawn = now;
      this.refined = this.resolution === 1;
    } else if (!this.refined && now - this.lastDrawn > STILL) {
      this.draw(1);
      this.refined = true;
    }
  };

  private draw(resolution: number): void {
    const pixelRatio = resolution * devicePixelRatio;
    this.play.refine(resolution === 1);
    if (this.renderer.getPixelRatio() !== pixelRatio) this.renderer.setPixelRatio(pixelRatio);
    this.renderer.render(this.scene, this.camera);
    this.fresh = false;
    this.frames++;
  }

  /** Trades resolution for frames where the machine is slow. */
  private adapt(now: number, passed: number): void {
    if (now - this.lastDrawn > 100) return;
    this.frameTime += (passed - this.frameTime) * 0.15;
    const factor = this.frameTime > SLOW ? 0.8 : this.frameTime < FAST && this.resolution < 1 ? 1.1 : 1;
    if (factor === 1) return;
    this.resolution = Math.min(1, Math.max(COARSEST, this.resolution * factor));
    this.frameTime = (SLOW + FAST) / 2;
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas.parentElement ?? this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    // On narrow screens there is no room beside what covers it.
    const covered = clientWidth > 1.8 * this.covered ? this.covered : 0;
    // What was in the middle moves to the middle of what is free, smaller where that is narrow.
    const smaller = Math.max(1, Math.min(clientWidth, clientHeight) / (clientWidth - covered));
    const [left, top] = [(clientWidth - smaller * (clientWidth + covered)) / 2, (clientHeight * (1 - smaller)) / 2];
    this.camera.setViewOffset(clientWidth, clientHeight, left, top, smaller * clientWidth, smaller * clientHeight);
    this.camera.updateProjectionMatrix();
    this.redraw();
  }
}

/** Whether this browser can draw at all. */
export function hasWebGL(): boolean {
  return document.createElement("canvas").getContext("webgl2") !== null;
}

/** A context without transparency, which would cost the browser a blend of the whole picture. */
function opaqueContext(canvas: HTMLCanvasElement): WebGL2RenderingContext {
  const options = { alpha: false, stencil: false, antialias: !isSoftware(), powerPreference: "high-performance" };
  return canvas.getContext("webgl2", options) as WebGL2RenderingContext;
}

/** Whether a processor does the drawing, for which smooth edges cost too much. */
function isSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const info = context?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(context?.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}
