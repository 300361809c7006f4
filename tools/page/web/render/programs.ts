// Programs of the GPU, compiled when they are asked for, one for each set of constants.
import shaders from 'shaders';

/** Constants of the shaders (march.glsl, medium.glsl), by name. */
export type Constants = Record<string, number>;
export type FragmentName = 'march' | 'pick' | 'slice' | 'gradients';

const PRECISION = 'precision highp float;precision highp int;precision highp sampler3D;\n';

/** A program, and where its uniforms are. */
export class Program {
    readonly gl: WebGL2RenderingContext;
    readonly program: WebGLProgram;
    #places: Map<string, WebGLUniformLocation> | null = null;
    #shaders: WebGLShader[];

    constructor(gl: WebGL2RenderingContext, vertex: string, fragment: string) {
        this.gl = gl;
        this.program = gl.createProgram()!;
        this.#shaders = [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]].map(([kind, text]) => {
            const shader = gl.createShader(kind as number)!;
            gl.shaderSource(shader, text as string);
            gl.compileShader(shader);
            gl.attachShader(this.program, shader);
            return shader;
        });
        gl.linkProgram(this.program);
    }

    /** True if it can be used without waiting for the compiler, as far as the browser tells. */
    get ready(): boolean {
        const parallel = this.gl.getExtension('KHR_parallel_shader_compile');
        return !parallel || this.gl.getProgramParameter(this.program, parallel.COMPLETION_STATUS_KHR) === true;
    }

    /** Makes it the current program. Waits for the compiler. */
    use(): this {
        const { gl, program } = this;
        if (!this.#places) {
            if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
                const log = this.#shaders.map((shader) => gl.getShaderInfoLog(shader)).join('');
                throw new Error(`The graphics driver does not accept a shader: ${log}${gl.getProgramInfoLog(program)}`);
            }
            this.#places = new Map();
            const count = gl.isContextLost() ? 0 : gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
            for (let i = 0; i < count; i++) {
                const { name } = gl.getActiveUniform(program, i)!;
                this.#places.set(name.replace(/\[0\]$/, ''), gl.getUniformLocation(program, name)!);
            }
            this.#shaders.forEach((shader) => gl.deleteShader(shader));
        }
        gl.useProgram(program);
        return this;
    }

    /** Sets a uniform of floats, of one to four numbers or rows of four, if the program has it. */
    floats(name: string, values: readonly number[], rows = 1): this {
        const place = this.#places!.get(name);
        if (place && rows > 0) this.gl[`uniform${values.length / rows as 1 | 2 | 3 | 4}fv`](place, values);
        return this;
    }

    /** The same for whole numbers without a sign. */
    words(name: string, values: readonly number[]): this {
        const place = this.#places!.get(name);
        if (place) this.gl[`uniform${values.length as 1 | 2 | 3 | 4}uiv`](place, values);
        return this;
    }

    /** A whole number, or the unit of an image. */
    whole(name: string, value: number): this {
        const place = this.#places!.get(name);
        if (place) this.gl.uniform1i(place, value);
        return this;
    }
}

/** All programs of a context. */
export class Programs {
    #gl: WebGL2RenderingContext;
    #made = new Map<string, Program>();

    constructor(gl: WebGL2RenderingContext) {
        this.#gl = gl;
    }

    /** The program of a fragment shader with these constants; others have the value of their declaration. */
    find(name: FragmentName, constants: Constants, multiview = false): Program {
        const key = JSON.stringify([name, constants, multiview]);
        let program = this.#made.get(key);
        if (!program) this.#made.set(key, program = this.#make(name, constants, multiview));
        return program;
    }

    #make(name: FragmentName, constants: Constants, multiview: boolean): Program {
        const version = `#version 300 es\n${multiview ? '#extension GL_OVR_multiview2:require\n' : ''}`;
        const view = `#define VIEW ${multiview ? 'gl_ViewID_OVR' : '0u'}\n`;
        const library = Object.entries(constants).reduce(
            (text, [constant, value]) => text.replace(new RegExp(`(const uint ${constant}=)\\d+u`), `$1${value}u`),
            shaders.library);
        return new Program(
            this.#gl,
            `${version}${multiview ? 'layout(num_views=2) in;' : ''}${shaders.whole}`,
            `${version}${PRECISION}${view}${library}\n${shaders[name]}`);
    }
}
