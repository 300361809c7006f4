// What is drawn in the room beside the patient: the panel, words, and lines; flat, over the picture, hidden
// by nothing (as xr-app/src/sheets.rs and marks.rs).
import type { Port, Vec3 } from '../types.ts';
import { add, cross, dot, length, scaled, sub } from '../render/vectors.ts';
import { direction, forward, type Pose, UP } from './pose.ts';

/** Metres a point of the panel. */
export const POINT = 0.001;
/**
 * Distance from the eye, metres, at which a point is as large as on the panel; words and lines always look so
 * large.
 */
const NEAR = 0.65;
/** Texels a point: as fine as a headset with 25 pixels a degree shows it from 0.6 m. */
export const TEXELS = 2;
/** Numbers a corner: place, place in the image, colour. */
const STRIDE = 9;

/** Red, green, blue and opacity, 0 to 1. */
export type Colour = [number, number, number, number];

/**
 * A plane in the room with points on it: the place of point (0, 0), a step to the right, and one down,
 * metres.
 */
export interface Plane {
    zero: Vec3;
    right: Vec3;
    down: Vec3;
}

/** The plane with a point at a place in the room that faces an eye, upright. */
export function facing([x, y]: [number, number], at: Vec3, eye: Vec3, metres: number): Plane {
    const towards = direction(sub(eye, at), [0, 0, 1]);
    const right = scaled(direction(cross(UP, towards), [1, 0, 0]), metres);
    const down = cross(right, towards);
    return { zero: sub(at, add(scaled(right, x), scaled(down, y))), right, down };
}

/** A plane that does so, on which points look equally large from wherever. */
export const label = (point: [number, number], at: Vec3, eye: Vec3): Plane =>
    facing(point, at, eye, (POINT * length(sub(at, eye))) / NEAR);

/** The place in the room of a point of a plane. */
export const onPlane = ({ zero, right, down }: Plane, x: number, y: number): Vec3 =>
    add(zero, add(scaled(right, x), scaled(down, y)));

/** The point of a plane that a ray meets, and its distance, metres. */
export function met(plane: Plane, ray: Pose): { x: number; y: number; distance: number } | null {
    const normal = cross(plane.right, plane.down);
    const along = forward(ray);
    const distance = dot(sub(plane.zero, ray.position), normal) / dot(along, normal);
    if (!(distance > 0 && Number.isFinite(distance))) return null;
    const on = sub(add(ray.position, scaled(along, distance)), plane.zero);
    const part = (axis: Vec3) => dot(on, axis) / dot(axis, axis);
    return { x: part(plane.right), y: part(plane.down), distance };
}

/** An eye to draw for: from the room to its space, and from there to the picture. */
export interface Eye {
    view: Float32Array;
    projection: Float32Array;
}

const VERTEX = `uniform mat4 view[2], projection[2];
layout(location = 0) in vec3 place;
layout(location = 1) in vec2 texel;
layout(location = 2) in vec4 tone;
out vec2 at;
out vec4 colour;
void main() {
    at = texel;
    colour = tone;
    gl_Position = projection[EYE] * (view[EYE] * vec4(place, 1.0));
}`;
// The texel in the lower left corner of the image is white.
const FRAGMENT = `#version 300 es
precision mediump float;
uniform sampler2D image;
in vec2 at;
in vec4 colour;
out vec4 shown;
void main() { shown = texture(image, at) * colour; }`;

export class Sheets {
    readonly #gl: WebGL2RenderingContext;
    readonly #program: WebGLProgram;
    readonly #corners: WebGLVertexArrayObject;
    readonly #buffer: WebGLBuffer;
    readonly #image: WebGLTexture;
    readonly #canvas: HTMLCanvasElement;
    #list: number[] = [];
    #stale = true;

    /** `canvas`: what is on the sheets, TEXELS a point. */
    constructor(gl: WebGL2RenderingContext, canvas: HTMLCanvasElement, multiview: boolean) {
        this.#gl = gl;
        this.#canvas = canvas;
        const head = multiview
            ? '#extension GL_OVR_multiview2 : require\nlayout(num_views = 2) in;\n#define EYE gl_ViewID_OVR'
            : 'uniform int eye;\n#define EYE eye';
        this.#program = gl.createProgram()!;
        for (const [kind, text] of [
            [gl.VERTEX_SHADER, `#version 300 es\n${head}\n${VERTEX}`], [gl.FRAGMENT_SHADER, FRAGMENT],
        ] as const) {
            const shader = gl.createShader(kind)!;
            gl.shaderSource(shader, text);
            gl.compileShader(shader);
            gl.attachShader(this.#program, shader);
            gl.deleteShader(shader);
        }
        gl.linkProgram(this.#program);
        this.#buffer = gl.createBuffer()!;
        this.#corners = gl.createVertexArray()!;
        gl.bindVertexArray(this.#corners);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.#buffer);
        [[3, 0], [2, 3], [4, 5]].forEach(([size, first], location) => {
            gl.enableVertexAttribArray(location);
            gl.vertexAttribPointer(location, size, gl.FLOAT, false, 4 * STRIDE, 4 * first);
        });
        gl.bindVertexArray(null);
        this.#image = gl.createTexture()!;
    }

    /** The canvas has changed. */
    refresh(): void {
        this.#stale = true;
    }

    /** Adds a rectangle of the canvas, points, on a plane whose points are those of the canvas. */
    rectangle(plane: Plane, [x, y, width, height]: [number, number, number, number]): void {
        const canvas = this.#canvas;
        const corner = (px: number, py: number) => {
            const texel = [(px * TEXELS) / canvas.width, (py * TEXELS) / canvas.height];
            return [...onPlane(plane, px, py), ...texel, 1, 1, 1, 1];
        };
        this.#quad(corner(x, y), corner(x + width, y), corner(x, y + height), corner(x + width, y + height));
    }

    /** Adds a line, `width` points wide, whose broad side faces the eye. */
    line(from: Vec3, to: Vec3, eye: Vec3, width: number, [r, g, b, a]: Colour): void {
        const towards = sub(eye, scaled(add(from, to), 0.5));
        const half = (0.5 * width * POINT * length(towards)) / NEAR;
        const across = scaled(direction(cross(sub(to, from), towards), UP), half);
        const white = [0.5 / this.#canvas.width, 1 - 0.5 / this.#canvas.height];
        const corner = (at: Vec3) => [...at, ...white, r * a, g * a, b * a, a];
        const below = [from, to].map((end) => corner(sub(end, across)));
        const above = [from, to].map((end) => corner(add(end, across)));
        this.#quad(below[0], below[1], above[0], above[1]);
    }

    #quad(a: number[], b: number[], c: number[], d: number[]): void {
        this.#list.push(...a, ...b, ...c, ...c, ...b, ...d);
    }

    /**
     * Draws into the bound framebuffer what was added, and forgets it. With multiview one call is for both
     * eyes.
     */
    draw(eyes: Eye[], calls: Port[]): void {
        const gl = this.#gl, program = this.#program, list = this.#list;
        if (!list.length) return;
        gl.useProgram(program);
        gl.activeTexture(gl.TEXTURE0);
        gl.bindTexture(gl.TEXTURE_2D, this.#image);
        this.#upload();
        const place = (name: string) => gl.getUniformLocation(program, name);
        gl.uniform1i(place('image'), 0);
        const both = (key: 'view' | 'projection') => eyes.flatMap((eye) => [...eye[key]]);
        gl.uniformMatrix4fv(place('view'), false, both('view'));
        gl.uniformMatrix4fv(place('projection'), false, both('projection'));
        gl.bindVertexArray(this.#corners);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.#buffer);
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(list), gl.STREAM_DRAW);
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
        calls.forEach(({ x, y, width, height }, eye) => {
            gl.viewport(x, y, width, height);
            gl.uniform1i(place('eye'), eye);
            gl.drawArrays(gl.TRIANGLES, 0, list.length / STRIDE);
        });
        gl.disable(gl.BLEND);
        gl.bindVertexArray(null);
        this.#list = [];
    }

    #upload(): void {
        const gl = this.#gl;
        if (!this.#stale) return;
        this.#stale = false;
        gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, this.#canvas);
        gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
        gl.generateMipmap(gl.TEXTURE_2D);
    }

    dispose(): void {
        const gl = this.#gl;
        gl.deleteProgram(this.#program);
        gl.deleteVertexArray(this.#corners);
        gl.deleteBuffer(this.#buffer);
        gl.deleteTexture(this.#image);
    }
}
