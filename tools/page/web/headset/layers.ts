// Where the pictures of the eyes go: into one image with a port for each eye, or, where both are drawn in one
// pass, into the layers of an image.
import type { Renderer } from '../render/renderer.ts';
import type { Port, Quality, View } from '../types.ts';

export interface Layer {
    readonly multiview: boolean;
    /** Where the picture of each eye is in this frame; null: an eye has none. */
    ports(views: readonly XRView[]): (Port | null)[];
    /**
     * Draws the eyes with `resolution` of the pixels along each edge, and leaves the framebuffer of the
     * headset bound, for what is drawn over it.
     */
    draw(renderer: Renderer, views: View[], ports: Port[], resolution: number, quality: Quality): void;
    /** The calls that draw over all eyes: with multiview one is enough. */
    calls(ports: Port[]): Port[];
    dispose(): void;
}

/** The port of a smaller picture. */
function part(x: number, width: number, height: number, resolution: number): Port {
    const [w, h] = [width, height].map((length) => Math.max(1, Math.round(length * resolution)));
    return { x, y: 0, width: w, height: h };
}

/** Enlarges a picture in the framebuffer that is read into a port of the one that is drawn. */
function enlarge(gl: WebGL2RenderingContext, from: Port, to: Port): void {
    const edges = ({ x, y, width, height }: Port) => [x, y, x + width, y + height] as const;
    gl.blitFramebuffer(...edges(from), ...edges(to), gl.COLOR_BUFFER_BIT, gl.LINEAR);
}

export class FlatLayer implements Layer {
    readonly multiview = false;
    readonly #gl: WebGL2RenderingContext;
    readonly #layer: XRWebGLLayer;
    /** The smaller pictures. */
    readonly #small: WebGLFramebuffer;
    #texture: WebGLTexture | null = null;
    #size = '';

    constructor(gl: WebGL2RenderingContext, session: XRSession) {
        this.#gl = gl;
        this.#layer = new XRWebGLLayer(session, gl, { antialias: false, depth: false, stencil: false });
        this.#layer.fixedFoveation = 1;
        this.#small = gl.createFramebuffer()!;
        session.updateRenderState({ baseLayer: this.#layer });
    }

    ports(views: readonly XRView[]): (Port | null)[] {
        return views.map((view) => this.#layer.getViewport(view) ?? null);
    }

    draw(renderer: Renderer, views: View[], ports: Port[], resolution: number, quality: Quality): void {
        const gl = this.#gl, { framebuffer } = this.#layer;
        const eyes = (at: Port[]) => views.map((view, i) => ({ view, port: at[i] }));
        if (resolution < 1) {
            let x = 0;
            const small = ports.map(({ width, height }) => {
                const port = part(x, width, height, resolution);
                x += port.width;
                return port;
            });
            this.#resize(x, Math.max(...small.map(({ height }) => height)));
            renderer.draw(eyes(small), this.#small, quality);
            gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#small);
            gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, framebuffer);
            small.forEach((port, i) => enlarge(gl, port, ports[i]));
        } else {
            renderer.draw(eyes(ports), framebuffer, quality);
        }
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    }

    #resize(width: number, height: number): void {
        const gl = this.#gl;
        if (this.#size === `${width} ${height}`) return;
        this.#size = `${width} ${height}`;
        gl.deleteTexture(this.#texture);
        this.#texture = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, this.#texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.#small);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.#texture, 0);
    }

    calls(ports: Port[]): Port[] {
        return ports;
    }

    dispose(): void {
        this.#gl.deleteFramebuffer(this.#small);
        this.#gl.deleteTexture(this.#texture);
    }
}

export class ArrayLayer implements Layer {
    readonly multiview = true;
    readonly #gl: WebGL2RenderingContext;
    readonly #extension: OVR_multiview2;
    readonly #binding: XRWebGLBinding;
    readonly #layer: XRProjectionLayer;
    readonly #framebuffers: WebGLFramebuffer[];
    #texture: WebGLTexture | null = null;
    #size = '';
    #sources: XRWebGLSubImage[] = [];

    /** True if a session offers what it takes. */
    static offered(session: XRSession, renderer: Renderer): boolean {
        const enabled = session.enabledFeatures?.includes('layers') ?? false;
        return renderer.multiview && enabled && 'createProjectionLayer' in XRWebGLBinding.prototype;
    }

    constructor(gl: WebGL2RenderingContext, session: XRSession) {
        this.#gl = gl;
        this.#extension = gl.getExtension('OVR_multiview2')!;
        this.#binding = new XRWebGLBinding(session, gl);
        this.#layer = this.#binding.createProjectionLayer({
            textureType: 'texture-array', colorFormat: gl.RGBA8, depthFormat: 0,
        });
        this.#layer.fixedFoveation = 1;
        // Of the headset's image, of the smaller one, and of a layer of each.
        this.#framebuffers = [0, 1, 2, 3].map(() => gl.createFramebuffer()!);
        session.updateRenderState({ layers: [this.#layer] });
    }

    ports(views: readonly XRView[]): (Port | null)[] {
        this.#sources = views.map((view) => this.#binding.getViewSubImage(this.#layer, view));
        return this.#sources.map(({ viewport }) => viewport);
    }

    draw(renderer: Renderer, views: View[], ports: Port[], resolution: number, quality: Quality): void {
        const gl = this.#gl, [whole, small, from, to] = this.#framebuffers;
        const image = this.#sources[0].colorTexture;
        const [{ width, height }] = ports;
        this.#attach(whole, image);
        if (resolution < 1) {
            const port = part(0, width, height, resolution);
            this.#resize(port.width, port.height);
            renderer.drawMultiview(views, small, port.width, port.height, quality);
            ports.forEach((eye, i) => {
                this.#attachLayer(gl.READ_FRAMEBUFFER, from, this.#texture!, i);
                this.#attachLayer(gl.DRAW_FRAMEBUFFER, to, image, this.#sources[i].imageIndex ?? i);
                enlarge(gl, port, eye);
            });
        } else {
            renderer.drawMultiview(views, whole, width, height, quality);
        }
        gl.bindFramebuffer(gl.FRAMEBUFFER, whole);
    }

    #attach(framebuffer: WebGLFramebuffer, texture: WebGLTexture): void {
        const gl = this.#gl;
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, framebuffer);
        this.#extension.framebufferTextureMultiviewOVR(
            gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, texture, 0, 0, 2);
    }

    #attachLayer(target: number, framebuffer: WebGLFramebuffer, texture: WebGLTexture, layer: number): void {
        const gl = this.#gl;
        gl.bindFramebuffer(target, framebuffer);
        gl.framebufferTextureLayer(target, gl.COLOR_ATTACHMENT0, texture, 0, layer);
    }

    #resize(width: number, height: number): void {
        const gl = this.#gl;
        if (this.#size === `${width} ${height}`) return;
        this.#size = `${width} ${height}`;
        gl.deleteTexture(this.#texture);
        this.#texture = gl.createTexture()!;
        gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.#texture);
        gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA8, width, height, 2);
        this.#attach(this.#framebuffers[1], this.#texture);
    }

    calls([port]: Port[]): Port[] {
        return [port];
    }

    dispose(): void {
        this.#framebuffers.forEach((framebuffer) => this.#gl.deleteFramebuffer(framebuffer));
        this.#gl.deleteTexture(this.#texture);
    }
}
