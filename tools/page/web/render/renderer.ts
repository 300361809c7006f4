// Draws a decoded field: the march of shaders-glsl/include/march.glsl, in WebGL2. What engine/render/src/raymarch.rs and
// gpu_volume.rs do on Vulkan is done here with images for buffers.
import type { Affine, Atlas, Look, Pick, Port, Quality, Vec3, View } from '../types.ts';
import { distances } from './leaps.ts';
import { type LookTables, lookTables, sceneRow } from './look.ts';
import { read } from './read.ts';
import { type Constants, type FragmentName, type Program, Programs } from './programs.ts';
import { add, column, inverse, length, moved, scaled, sub } from './vectors.ts';

/** Texels of a row of an image that stands for a buffer (inputs.glsl). */
const ROW = 4096;
/** Lengths of a cell, and its steps, where none are asked for (raymarch.rs). */
const USUAL_CELLS = [1, 1.5];
const USUAL_PARTS = 4;
/** How far V is taken to go beyond its values at the ends of a cell, as a part of the range. */
const SLACK = 1 / 32;
/** Least light: rays end when less would pass. */
const LEAST_LIGHT = 1 / 512;
/** The greatest O (V - v₀) times the unit of the gradients, so that they fit halves (voxel_gradients.rs). */
const GREATEST = 8192;
/** Bytes that gradients of all voxels may take; else each light takes six samples. */
const MOST_GRADIENTS = 2 ** 28;
/** Opacity above which a ray has met something. */
const MET = 0.02;

/** An image that stands for a buffer, or holds a volume. */
interface Image {
    texture: WebGLTexture;
    target: number;
}

export class Renderer {
    readonly gl: WebGL2RenderingContext;
    readonly atlas: Atlas;
    /** Origin of the space of the scene, mm RAS: the middle of the box, so that numbers are small. */
    readonly origin: Vec3;
    /** Half the diagonal of the box, mm. */
    readonly radius: number;
    /** The shortest edge of a voxel, mm. */
    readonly spacing: number;
    /** True if both eyes can be drawn in one pass. */
    readonly multiview: boolean;
    /** False where the room is seen behind the scene: the picture then has no background. */
    opaque = true;
    #programs: Programs;
    #images = new Map<string, Image>();
    #voxelFromScene: Affine;
    #framebuffer: WebGLFramebuffer;
    #tables: LookTables | null = null;
    #look: Look | null = null;
    #row: Record<string, number[]> = {};
    /** Functions and visible parts that the distances were found for; what the gradients were made of. */
    #marked: Uint32Array | null = null;
    #gradientsOf = '';
    #keepsGradients: boolean;

    constructor(gl: WebGL2RenderingContext, atlas: Atlas) {
        this.gl = gl;
        this.atlas = atlas;
        this.#programs = new Programs(gl);
        this.multiview = gl.getExtension('OVR_multiview2') !== null;
        gl.getExtension('KHR_parallel_shader_compile');
        const drawable = ['EXT_color_buffer_half_float', 'EXT_color_buffer_float'].map((name) => gl.getExtension(name));
        const { dims, size, worldFromVoxel } = atlas;
        const texels = dims[0] * dims[1] * dims[2];
        this.#keepsGradients = drawable.some((extension) => extension !== null) && texels * 8 <= MOST_GRADIENTS;
        const corner = size.map((n) => n - 1) as Vec3;
        this.origin = moved(worldFromVoxel, scaled(corner, 0.5)).map(Math.round) as Vec3;
        const axes = [0, 1, 2].map((k) => column(worldFromVoxel, k));
        this.spacing = Math.min(...axes.map(length));
        this.radius = 0.5 * length(sub(moved(worldFromVoxel, corner), moved(worldFromVoxel, [0, 0, 0])));
        const sceneFromVoxel = worldFromVoxel.map((v, i) => (i % 4 === 3 ? v - this.origin[(i - 3) / 4] : v));
        this.#voxelFromScene = inverse(sceneFromVoxel as Affine);
        this.#framebuffer = gl.createFramebuffer()!;
        gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
        this.#volume('medium', gl.RG16F, dims, gl.LINEAR);
        gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, 0, ...dims, gl.RG, gl.HALF_FLOAT, atlas.texels);
        this.#volume('labels', gl.RG8, atlas.labels ? dims : [1, 1, 1], gl.NEAREST);
        const labels = atlas.labels ?? Uint8Array.of(atlas.label, 255);
        const labelled: Vec3 = atlas.labels ? dims : [1, 1, 1];
        gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, 0, ...labelled, gl.RG, gl.UNSIGNED_BYTE, labels);
        this.#volume('gradients', gl.RGBA16F, this.#keepsGradients ? dims : [1, 1, 1], gl.LINEAR);
        this.#rows('places', gl.R32UI, atlas.places);
        this.#rows('brick_at', gl.R32UI, atlas.brickAt);
    }

    /** Bytes of the images. */
    get bytes(): number {
        const texels = this.atlas.dims[0] * this.atlas.dims[1] * this.atlas.dims[2];
        return texels * (4 + (this.atlas.labels ? 2 : 0) + (this.#keepsGradients ? 8 : 0));
    }

    /**
     * Changes how the scene is shown. `draft`: gradients stay those of the look before, since they take longer than
     * all else.
     */
    setLook(look: Look, draft = false): void {
        const { gl, atlas } = this;
        const tables = lookTables(look, atlas);
        this.#look = look;
        this.#row = sceneRow(look, tables, this.origin);
        const marked = tables.visibleBefore;
        const same = this.#tables !== null && this.#marked!.length === marked.length
            && this.#tables.tables.every((table, i) => table === tables.tables[i])
            && this.#tables.tables.length === tables.tables.length;
        if (!same) {
            this.#rows('look_points', gl.RG32UI, joined(tables.tables.map((table) => table.points)));
            this.#rows('look_integrals', gl.RGBA32UI, joined(tables.tables.map((table) => table.integrals)));
            this.#rows('gradient_factors', gl.R32F, joined(tables.tables.map((table) => table.gradientFactors)));
            this.#rows('visible_before', gl.R32UI, marked);
            let offset = 0;
            const rows = tables.tables.flatMap((table) => {
                const { first, step, length, integralUnit, gradientStep } = table;
                const row = [first, 1 / step, length - 1, integralUnit, 1 / gradientStep, offset, 0, 0];
                offset += length;
                return row;
            });
            this.#table('look_rows', Float32Array.from(rows));
            this.#rows('distances', gl.R8UI, distances(atlas, tables));
            this.#marked = marked;
        }
        this.#table('appearances', tables.appearances);
        this.#tables = tables;
        const key = `${tables.dark} ${tables.shown}`;
        const needed = this.#keepsGradients && (tables.shaded || tables.graded);
        if (needed && this.#gradientsOf !== key && !(draft && this.#gradientsOf)) this.#makeGradients(key);
    }

    /** True if what is drawn next is lit as another look was. */
    get stale(): boolean {
        const { dark, shown, shaded, graded } = this.#tables!;
        return this.#keepsGradients && (shaded || graded) && this.#gradientsOf !== `${dark} ${shown}`;
    }

    /** True if the programs for the look at a quality are there; starts the compiler if not. */
    isReady(quality: Quality, multiview = false): boolean {
        return this.#programs.find('march', this.#constants(quality), multiview).ready;
    }

    /** Resolves when the programs for the look at a quality are there. */
    async prepare(quality: Quality, multiview = false): Promise<void> {
        while (!this.isReady(quality, multiview) && !this.gl.isContextLost())
            await new Promise((done) => setTimeout(done, 10));
    }

    /** Draws views, each into its port; only rows from `rows[0]` up to `rows[1]` of it, from below, if they are given. */
    draw(
        views: { view: View; port: Port }[], framebuffer: WebGLFramebuffer | null, quality: Quality,
        rows?: [number, number],
    ): void {
        const { gl } = this;
        const program = this.#program('march', quality);
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        for (const { view, port } of views) {
            const { x, y, width, height } = port;
            this.#place(program, [view], width, height);
            program.floats('port', [x, y, width, height]);
            gl.viewport(x, y, width, height);
            gl.enable(gl.SCISSOR_TEST);
            const [low, high] = rows ?? [0, height];
            gl.scissor(x, y + low, width, high - low);
            gl.drawArrays(gl.TRIANGLES, 0, 3);
        }
        gl.disable(gl.SCISSOR_TEST);
    }

    /** Draws both eyes in one pass into the two layers of a framebuffer (OVR_multiview2). */
    drawMultiview(views: View[], framebuffer: WebGLFramebuffer, width: number, height: number, quality: Quality): void {
        const { gl } = this;
        const program = this.#program('march', quality, true);
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        this.#place(program, views, width, height);
        program.floats('port', [0, 0, width, height]);
        gl.viewport(0, 0, width, height);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    /** What lies at a place of a picture of this size, pixels from its upper left corner; null where nothing is. */
    async pick(view: View, width: number, height: number, x: number, y: number): Promise<Pick | null> {
        const program = this.#program('pick', { step: 0.25, cell: null, occlusion: false });
        this.#place(program, [view], width, height);
        program.floats('at', [x, y]).floats('given', [0, 0, 0, 0]);
        const [depth, opacity, value, object] = await this.#met();
        if (!(opacity > MET)) return null;
        const [left, right, upper, lower] = view.tangents;
        const across = left + (x / width) * (right - left), upwards = upper + (y / height) * (lower - upper);
        const toward = add(add(scaled(view.right, across), scaled(view.up, upwards)), view.forward);
        return { place: add(view.eye, scaled(toward, depth)), value, object: Math.round(object) };
    }

    /** V and the object at a place, mm RAS; null where nothing is. */
    async valueAt(place: Vec3): Promise<Pick | null> {
        const program = this.#program('pick', { step: 1, cell: null, occlusion: false });
        const voxel = moved(this.#voxelFromScene, sub(place, this.origin));
        const { size } = this.atlas;
        if (!voxel.every((v, k) => v > -1 && v < size[k])) return null;
        program.floats('given', [...voxel, 1]);
        const [, occupancy, value, object] = await this.#met();
        return occupancy >= 0.5 ? { place, value, object: Math.round(object) } : null;
    }

    /**
     * Draws a plane through the field into the lower left corner of a framebuffer, in grey between the ends of a window:
     * from the place at the upper left corner over the edges of the picture, mm RAS.
     */
    slice(
        from: Vec3, across: Vec3, down: Vec3, window: [number, number], framebuffer: WebGLFramebuffer | null,
        width: number, height: number,
    ): void {
        const { gl } = this;
        const program = this.#program('slice', { step: 1, cell: null, occlusion: false });
        this.#place(program, [], width, height);
        const start = moved(this.#voxelFromScene, sub(from, this.origin));
        const way = (edge: Vec3) => sub(moved(this.#voxelFromScene, sub(add(from, edge), this.origin)), start);
        program.floats('from', start).floats('across', way(across)).floats('down', way(down));
        program.floats('window', [window[0], window[1] - window[0]]).floats('size', [width, height]);
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.viewport(0, 0, width, height);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    /** Draws one texel of the program in use, and reads it. */
    async #met(): Promise<Float32Array> {
        const { gl } = this;
        const { texture } = this.#image('picked', gl.TEXTURE_2D, gl.RGBA32UI, [1, 1, 1]);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
        gl.viewport(0, 0, 1, 1);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        const words = new Uint32Array(4);
        await read(gl, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
        return new Float32Array(words.buffer);
    }

    /** Frees what the GPU holds. */
    dispose(): void {
        for (const { texture } of this.#images.values()) this.gl.deleteTexture(texture);
        this.#images.clear();
        this.gl.deleteFramebuffer(this.#framebuffer);
    }

    #constants(quality: Quality): Constants {
        const { preIntegrated, shaded, occluded, graded, objects } = this.#tables!;
        return {
            MASKED: 1, ATLAS: 1, OBJECTS: objects, SEGMENTS: Number(preIntegrated), SHADED: Number(shaded),
            OCCLUDED: Number(occluded && quality.occlusion), GRADED: Number(graded), KEPT: Number(this.#keepsGradients),
        };
    }

    /** The program of a fragment shader for the look, in use, with all that does not depend on the view. */
    #program(name: FragmentName, quality: Quality, multiview = false): Program {
        const program = this.#programs.find(name, this.#constants(quality), multiview).use();
        const { atlas, spacing } = this;
        const usual = Math.min(Math.max(USUAL_PARTS * quality.step, USUAL_CELLS[0]), USUAL_CELLS[1]);
        const cell = Math.max(quality.cell ?? usual, quality.step);
        program.words('p.grid.texels', atlas.size).words('p.grid.bricks', atlas.leaps.bricks);
        program.words('p.grid.shift', atlas.leaps.shift);
        program.floats('p.voxel_from_scene', this.#voxelFromScene, 3);
        program.floats('p.first', [atlas.middle]).floats('p.span', [atlas.scale]);
        program.floats('p.cell', [cell * spacing]).words('p.parts', [Math.round(cell / quality.step)]);
        program.floats('p.slack', [(atlas.range[1] - atlas.range[0]) * SLACK]).floats('p.dark', [LEAST_LIGHT]);
        program.floats('p.edge', [atlas.edge * (this.#keepsGradients ? 1 / this.#gradientUnit() : 1)]);
        for (const [key, values] of Object.entries(this.#row))
            program.floats(`look_scene.${key}`, values, key === 'planes' ? values.length / 4 : 1);
        program.words('look_scene.plane_count', [this.#look!.clip.length]).words('look_scene.offset', [0]);
        program.words('look_scene.light_turns', [this.#look!.light.fixedTo === 'patient' ? 1 : 0]);
        program.floats('background', this.opaque ? [...this.#look!.background, 1] : [0, 0, 0, 0]);
        this.#bind(program);
        return program;
    }

    #place(program: Program, views: View[], width: number, height: number): void {
        program.words('p.size', [width, height]);
        views.forEach((view, i) => {
            program.floats(`views[${i}].eye`, sub(view.eye, this.origin)).floats(`views[${i}].right`, view.right);
            program.floats(`views[${i}].up`, view.up).floats(`views[${i}].forward`, view.forward);
            program.floats(`views[${i}].tangents`, view.tangents);
        });
    }

    /** Binds all images, each to a unit of its own. */
    #bind(program: Program): void {
        const { gl } = this;
        let unit = 0;
        for (const [name, { texture, target }] of this.#images) {
            gl.activeTexture(gl.TEXTURE0 + unit);
            gl.bindTexture(target, texture);
            program.whole(target === gl.TEXTURE_3D ? name : `${name}_image`, unit++);
        }
        // What follows may bind images for work of its own.
        gl.activeTexture(gl.TEXTURE0 + unit);
    }

    /** What a gradient of 1 in the image stands for is its inverse: V over a voxel. */
    #gradientUnit(): number {
        const [low, high] = this.atlas.range, { dark } = this.#tables!;
        return GREATEST / Math.max(Math.abs(dark - low), Math.abs(high - dark), 1e-30);
    }

    #makeGradients(key: string): void {
        const { gl, atlas } = this;
        const { dark, objects } = this.#tables!;
        const program = this.#programs.find('gradients', { MASKED: 1, ATLAS: 1, OBJECTS: objects ? 1 : 0 }).use();
        program.words('grid.texels', atlas.size).words('grid.bricks', atlas.leaps.bricks);
        program.words('grid.shift', atlas.leaps.shift);
        program.floats('dark', [(dark - atlas.middle) / atlas.scale]).floats('unit', [this.#gradientUnit() * atlas.scale]);
        // Not the image that is drawn into.
        const gradients = this.#images.get('gradients')!;
        this.#images.delete('gradients');
        this.#bind(program);
        this.#images.set('gradients', gradients);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.#framebuffer);
        gl.viewport(0, 0, atlas.dims[0], atlas.dims[1]);
        for (let layer = 0; layer < atlas.dims[2]; layer++) {
            gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gradients.texture, 0, layer);
            program.whole('layer', layer);
            gl.drawArrays(gl.TRIANGLES, 0, 3);
        }
        this.#gradientsOf = key;
    }

    #volume(name: string, format: number, size: Vec3, filter: number): void {
        const { gl } = this;
        this.#image(name, gl.TEXTURE_3D, format, size);
        gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MIN_FILTER, filter);
        gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MAG_FILTER, filter);
    }

    /** Writes a buffer into an image of rows; one that has the room is written in place. */
    #rows(name: string, format: number, values: Uint8Array | Uint32Array | Float32Array): void {
        const { gl } = this;
        const [layout, type, channels] = new Map<number, [number, number, number]>([
            [gl.R8UI, [gl.RED_INTEGER, gl.UNSIGNED_BYTE, 1]], [gl.R32UI, [gl.RED_INTEGER, gl.UNSIGNED_INT, 1]],
            [gl.RG32UI, [gl.RG_INTEGER, gl.UNSIGNED_INT, 2]], [gl.RGBA32UI, [gl.RGBA_INTEGER, gl.UNSIGNED_INT, 4]],
            [gl.R32F, [gl.RED, gl.FLOAT, 1]],
        ]).get(format)!;
        const count = values.length / channels, whole = Math.floor(count / ROW), rest = count % ROW;
        this.#image(name, gl.TEXTURE_2D, format, [ROW, Math.ceil(count / ROW), 1]);
        if (whole) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ROW, whole, layout, type, values);
        if (rest) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, whole, rest, 1, layout, type, values, whole * ROW * channels);
    }

    /** Writes rows of eight floats. */
    #table(name: string, values: Float32Array): void {
        const { gl } = this;
        this.#image(name, gl.TEXTURE_2D, gl.RGBA32F, [2, values.length / 8, 1]);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 2, values.length / 8, gl.RGBA, gl.FLOAT, values);
    }

    #sizes = new Map<string, string>();

    /** The image of this name and size, bound; makes it if it is not there or has another size. */
    #image(name: string, target: number, format: number, size: Vec3): Image {
        const { gl } = this;
        const key = size.join();
        let image = this.#images.get(name);
        if (image && this.#sizes.get(name) !== key) gl.deleteTexture(image.texture);
        if (!image || this.#sizes.get(name) !== key) {
            image = { texture: gl.createTexture()!, target };
            this.#images.set(name, image);
            this.#sizes.set(name, key);
            gl.bindTexture(target, image.texture);
            if (target === gl.TEXTURE_3D) gl.texStorage3D(target, 1, format, ...size);
            else gl.texStorage2D(target, 1, format, size[0], size[1]);
            gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
            gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
            for (const edge of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R])
                gl.texParameteri(target, edge, gl.CLAMP_TO_EDGE);
        }
        gl.bindTexture(target, image.texture);
        return image;
    }
}

/** Arrays one after the other. */
function joined<T extends Uint32Array | Float32Array>(arrays: T[]): T {
    if (arrays.length === 1) return arrays[0];
    const all = new (arrays[0].constructor as { new (length: number): T })(arrays.reduce((n, a) => n + a.length, 0));
    let at = 0;
    for (const array of arrays) {
        all.set(array, at);
        at += array.length;
    }
    return all;
}
