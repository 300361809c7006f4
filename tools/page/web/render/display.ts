// The picture of a page: keeps a frame time while something changes, and converges when nothing does.
import type { Atlas, Look, Pick, Quality, Vec3, View } from '../types.ts';
import { Levels } from './levels.ts';
import { Renderer } from './renderer.ts';
import { read } from './read.ts';
import { column, moved } from './vectors.ts';

/** Longest frame while something moves, ms. */
const FRAME = 33;
/** What a band of the finished picture may take, ms: whoever begins to drag meanwhile waits no longer. */
const BAND = 50;
/** The finished picture is shown as far as it is there so often, ms: to show it costs, too. */
const SHOWN = 1000;
/** A finished picture has a sample every quarter of a voxel where something shows. */
const FINISHED: Quality = { step: 0.25, cell: null, occlusion: true };
/** A picture is finished when nothing has changed for this long, ms. */
const REST = 150;

/** A plane through the field: its upper left corner and its edges, mm RAS. */
export interface Slice {
    from: Vec3;
    across: Vec3;
    down: Vec3;
}

export class Display {
    readonly canvas: HTMLCanvasElement;
    readonly atlas: Atlas;
    readonly gl: WebGL2RenderingContext;
    renderer: Renderer;
    /** Share of the finished picture that is there; 1: it is shown. */
    onprogress: ((share: number) => void) | null = null;
    /** The context of the GPU was lost, or is there again. */
    onlost: ((lost: boolean) => void) | null = null;
    /** A view is shown that was not shown before; what lies over the picture goes along. */
    onview: (() => void) | null = null;
    /** After each frame that was drawn while something moved. */
    onframe: (() => void) | null = null;
    readonly #levels = new Levels(FRAME);
    #frames: number[] = [];
    #view: ((aspect: number) => View) | null = null;
    #look: Look | null = null;
    #newLook = false;
    #changed = false;
    #lastChange = 0;
    /** Rows of the finished picture, from above, that are shown. */
    #rows = 0;
    #rowsPerMs = 0.2;
    #shown = 0;
    /** Pixels of the draft. */
    #drafted: [number, number] = [1, 1];
    #flight: { sync: WebGLSync; since: number; rows: number } | null = null;
    #targets: Map<string, { texture: WebGLTexture; framebuffer: WebGLFramebuffer }> = new Map();
    #asked = false;
    #suspended = false;
    #lost = false;

    /** Throws a sentence where WebGL2 is missing. */
    constructor(canvas: HTMLCanvasElement, atlas: Atlas) {
        const gl = canvas.getContext('webgl2', {
            alpha: false, depth: false, stencil: false, antialias: false, powerPreference: 'high-performance',
        });
        if (!gl) throw new Error('This browser has no WebGL2, or its graphics driver is switched off.');
        this.canvas = canvas;
        this.atlas = atlas;
        this.gl = gl;
        this.renderer = new Renderer(gl, atlas);
        canvas.addEventListener('webglcontextlost', this.#whenLost);
        canvas.addEventListener('webglcontextrestored', this.#whenRestored);
        this.resize();
    }

    /** Milliseconds of the frames while something moved, the level that holds the frame time, and what draws. */
    get stats(): { frames: number[]; level: string; device: string } {
        const { gl } = this;
        const names = gl.getExtension('WEBGL_debug_renderer_info');
        const device = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER) as string;
        return { frames: this.#frames, level: this.#levels.name, device };
    }

    /** Changes how the scene is shown. The look is not to be changed afterwards. */
    setLook(look: Look): void {
        this.#look = look;
        this.#newLook = true;
        this.#change();
    }

    /** Changes where it is seen from; the function gets the width of the picture over its height. */
    setView(view: (aspect: number) => View): void {
        this.#view = view;
        this.#change();
    }

    /** Takes over the size that the canvas has on the page. */
    resize(): void {
        const density = Math.min(window.devicePixelRatio || 1, 2);
        const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight]
            .map((n) => Math.max(Math.round(n * density), 1));
        if (this.canvas.width === width && this.canvas.height === height) return;
        this.canvas.width = width;
        this.canvas.height = height;
        this.#freeTargets();
        this.#change();
    }

    /** What lies at a place, CSS pixels from the upper left corner of the canvas. */
    async pick(x: number, y: number): Promise<Pick | null> {
        const { canvas } = this, view = this.#view;
        if (!view || !this.#look || this.#lost || this.#suspended) return null;
        this.#takeLook(false);
        const { width, height } = canvas;
        const scale = width / (canvas.clientWidth || width);
        return this.renderer.pick(view(width / height), width, height, x * scale, y * scale);
    }

    /** V and the object at a place, mm RAS; null where nothing is. */
    async valueAt(place: Vec3): Promise<Pick | null> {
        if (!this.#look || this.#lost || this.#suspended) return null;
        this.#takeLook(false);
        return this.renderer.valueAt(place);
    }

    /** The finished picture as PNG. */
    async snapshot(): Promise<Blob> {
        while (!this.#isFinished && !this.#lost) await new Promise((done) => setTimeout(done, 20));
        this.#show('finished', this.canvas.width, this.canvas.height);
        return new Promise((done, failed) => this.canvas.toBlob((blob) =>
            blob ? done(blob) : failed(new Error('The browser could not write the picture.')), 'image/png'));
    }

    /**
     * The plane through a place along an axis of RAS over all that is there, as radiologists see it: axial from below,
     * coronal from before, sagittal from the left.
     */
    plane(axis: 0 | 1 | 2, place: number): Slice {
        const [low, high] = this.bounds;
        const edge = (k: number): Vec3 => [0, 1, 2].map((i) => (i === k ? low[k] - high[k] : 0)) as Vec3;
        const from = high.slice() as Vec3;
        from[axis] = place;
        const [across, down] = ([[1, 2], [0, 2], [0, 1]] as const)[axis];
        return { from, across: edge(across), down: edge(down) };
    }

    /** The corners of the box around all that is there, mm RAS. */
    get bounds(): [Vec3, Vec3] {
        const { size, worldFromVoxel } = this.atlas;
        const first = moved(worldFromVoxel, [0, 0, 0]);
        const low = first.slice() as Vec3, high = first.slice() as Vec3;
        for (let k = 0; k < 3; k++) for (let i = 0; i < 3; i++) {
            const edge = column(worldFromVoxel, k)[i] * (size[k] - 1);
            if (edge < 0) low[i] += edge; else high[i] += edge;
        }
        return [low, high];
    }

    /** Draws V on such a plane into a canvas, whose pixels are kept: grey from the lower to the upper end of a window. */
    async slice(
        axis: 0 | 1 | 2, place: number, window: [number, number], canvas: HTMLCanvasElement,
    ): Promise<Slice> {
        const plane = this.plane(axis, place), { width, height } = canvas;
        if (this.#lost || this.#suspended || !this.#look) return plane;
        this.#takeLook(false);
        const { gl } = this;
        const framebuffer = this.#target(`slice ${width} ${height}`, width, height);
        this.renderer.slice(plane.from, plane.across, plane.down, window, framebuffer, width, height);
        const pixels = new Uint8Array(4 * width * height);
        await read(gl, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        const rows = new Uint8ClampedArray(pixels.length);
        for (let y = 0; y < height; y++)
            rows.set(pixels.subarray(4 * width * (height - 1 - y), 4 * width * (height - y)), 4 * width * y);
        canvas.getContext('2d')!.putImageData(new ImageData(rows, width, height), 0, 0);
        return plane;
    }

    /** Leaves the context to somebody else, until it is taken back. */
    suspend(): void {
        this.#suspended = true;
    }

    resume(): void {
        this.#suspended = false;
        this.#newLook = this.#look !== null;
        this.#change();
    }

    dispose(): void {
        this.#suspended = true;
        this.canvas.removeEventListener('webglcontextlost', this.#whenLost);
        this.canvas.removeEventListener('webglcontextrestored', this.#whenRestored);
        this.#freeTargets();
        this.renderer.dispose();
    }

    get #isFinished(): boolean {
        return !this.#changed && !this.#newLook && this.#rows >= this.canvas.height;
    }

    #whenLost = (event: Event): void => {
        event.preventDefault();
        this.#lost = true;
        this.#flight = null;
        this.onlost?.(true);
    };

    #whenRestored = (): void => {
        this.#lost = false;
        this.#targets.clear();
        this.renderer = new Renderer(this.gl, this.atlas);
        this.resume();
        this.onlost?.(false);
    };

    #change(): void {
        this.#changed = true;
        this.#rows = 0;
        this.#lastChange = performance.now();
        this.#ask();
    }

    #ask(): void {
        if (this.#asked || this.#suspended || this.#lost) return;
        this.#asked = true;
        const frame = () => {
            this.#asked = false;
            if (this.#suspended || this.#lost || !this.#view || !this.#look) return;
            this.#frame();
            if (!this.#isFinished) this.#ask();
        };
        // Bands of the finished picture do not wait for the screen.
        if (this.#rows > 0) setTimeout(frame, 4); else requestAnimationFrame(frame);
    }

    #frame(): void {
        if (this.#flight && !this.#landed()) return;
        if (this.#changed) this.#draft();
        else if (performance.now() - this.#lastChange >= REST) this.#refine();
    }

    /** Whether what was submitted last is done. */
    #landed(): boolean {
        const { gl } = this, { sync, since, rows } = this.#flight!;
        if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
        gl.deleteSync(sync);
        this.#flight = null;
        const ms = performance.now() - since;
        if (rows > 0) {
            this.#rowsPerMs = 0.5 * (this.#rowsPerMs + rows / ms);
        } else {
            this.#levels.took(ms);
            this.#frames.push(ms);
            if (this.#frames.length > 4096) this.#frames.splice(0, 2048);
            this.onframe?.();
        }
        return true;
    }

    /** The look that was set last, on the GPU. A draft is lit as the look before. */
    #takeLook(draft: boolean): void {
        if (this.#newLook || (!draft && this.renderer.stale)) this.renderer.setLook(this.#look!, draft);
        this.#newLook = false;
    }

    #draft(): void {
        this.#takeLook(true);
        const { level } = this.#levels, { width, height } = this.canvas;
        const quality = { step: level.coarseness, cell: null, occlusion: false };
        if (!this.renderer.isReady(quality)) return;
        this.#changed = false;
        const [w, h] = [width, height].map((n) => Math.max(Math.round(n * level.resolution), 1));
        const framebuffer = this.#target('draft', width, height);
        const since = performance.now();
        const view = this.#view!(width / height);
        this.renderer.draw([{ view, port: { x: 0, y: 0, width: w, height: h } }], framebuffer, quality);
        this.#drafted = [w, h];
        this.#show('draft', w, h);
        this.onview?.();
        this.#fly(since, 0);
        this.onprogress?.(0);
    }

    /** Goes on with the finished picture, from above; what is there of it is shown. */
    #refine(): void {
        this.#takeLook(false);
        if (!this.renderer.isReady(FINISHED)) return;
        const { width, height } = this.canvas;
        const rows = Math.min(Math.max(Math.round(BAND * this.#rowsPerMs), 1), height - this.#rows);
        const framebuffer = this.#target('finished', width, height);
        const since = performance.now();
        const view = this.#view!(width / height);
        const above = height - this.#rows;
        this.renderer.draw(
            [{ view, port: { x: 0, y: 0, width, height } }], framebuffer, FINISHED, [above - rows, above]);
        this.#rows += rows;
        if (this.#rows >= height || since - this.#shown > SHOWN) {
            this.#shown = since;
            this.#show('draft', ...this.#drafted);
            this.#show('finished', width, height, this.#rows);
            this.onprogress?.(this.#rows / height);
        }
        this.#fly(since, rows);
    }

    #fly(since: number, rows: number): void {
        const sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0)!;
        this.gl.flush();
        this.#flight = { sync, since, rows };
    }

    /** Draws the lower left part of a target over all of the canvas, or only so many rows from above. */
    #show(name: string, width: number, height: number, rows = height): void {
        const { gl, canvas } = this, target = this.#targets.get(name);
        if (!target) return;
        gl.bindFramebuffer(gl.READ_FRAMEBUFFER, target.framebuffer);
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
        // Browsers clear the canvas before the first drawing of a frame, and some after a blit that comes first.
        if (rows >= height) gl.clear(gl.COLOR_BUFFER_BIT);
        const from = rows < height ? height - rows : 0;
        gl.blitFramebuffer(
            0, from, width, height, 0, from, canvas.width, canvas.height, gl.COLOR_BUFFER_BIT,
            width === canvas.width ? gl.NEAREST : gl.LINEAR);
    }

    #target(name: string, width: number, height: number): WebGLFramebuffer {
        const made = this.#targets.get(name);
        if (made) return made.framebuffer;
        const { gl } = this, texture = gl.createTexture()!, framebuffer = gl.createFramebuffer()!;
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
        this.#targets.set(name, { texture, framebuffer });
        return framebuffer;
    }

    #freeTargets(): void {
        for (const { texture, framebuffer } of this.#targets.values()) {
            this.gl.deleteTexture(texture);
            this.gl.deleteFramebuffer(framebuffer);
        }
        this.#targets.clear();
    }
}
