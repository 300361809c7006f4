// What tests of the picture call in the browser.
import { decode } from '../field/worker.ts';
import { Renderer } from '../render/renderer.ts';
import { Display } from '../render/display.ts';
import type { Atlas, Look, Part, Pick, Quality, View } from '../types.ts';

const canvas = document.createElement('canvas');
const gl = canvas.getContext('webgl2')!;
let atlas: Atlas, renderer: Renderer;

const api = {
    async load(parts: (Part & { text: string })[]): Promise<object> {
        const data = parts.map((part) => ({ ...part, data: Uint8Array.from(atob(part.text), (c) => c.charCodeAt(0)) }));
        atlas = await decode(data, () => {});
        renderer = new Renderer(gl, atlas);
        const { size, range, dims, times, splats } = atlas;
        return { size, range, dims, times, splats, bytes: renderer.bytes };
    },
    /** Display-referred RGBA, rows from the top, and the time of the frame, ms. */
    picture(view: View, look: Look, objects: [number, Look['objects'] extends Map<number, infer A> ? A : never][],
        quality: Quality, width: number, height: number): { text: string; ms: number } {
        renderer.setLook({ ...look, objects: new Map(objects) });
        const texture = gl.createTexture()!, framebuffer = gl.createFramebuffer()!;
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        const pixels = new Uint8Array(4 * width * height);
        let since = 0;
        const draw = () => {
            renderer.draw([{ view, port: { x: 0, y: 0, width, height } }], framebuffer, quality);
        };
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
        for (let i = 0; i < 2; i++) {
            since = performance.now();
            draw();
            gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        }
        const ms = performance.now() - since;
        const error = gl.getError();
        if (error) throw new Error(`WebGL error ${error}`);
        gl.deleteTexture(texture);
        gl.deleteFramebuffer(framebuffer);
        let text = '';
        for (let y = height - 1; y >= 0; y--)
            text += String.fromCharCode(...pixels.subarray(4 * width * y, 4 * width * (y + 1)));
        return { text: btoa(text), ms };
    },
    setLookMs(look: Look): number {
        const since = performance.now();
        renderer.setLook(look, true);
        return performance.now() - since;
    },
    /** What lies under places of the picture that was drawn last, and what is said of those places themselves. */
    async read(view: View, size: number, places: [number, number][]): Promise<(Pick | null)[][]> {
        const read = [];
        for (const [x, y] of places) {
            const met = await renderer.pick(view, size, size, x, y);
            read.push([met, met && await renderer.valueAt(met.place)]);
        }
        return read;
    },
    Display,
};
Object.assign(window, { api });
