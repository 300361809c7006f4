// What the parts of the page tell one another. Lengths are in mm, world space is RAS (x to the patient's right, y to the
// front, z to the head); voxels are those of the box that an atlas covers. Matrices are affine: three rows of four.

export type Vec3 = [number, number, number];
/** Rows of a 3 × 4 affine matrix. */
export type Affine = [
    number, number, number, number, number, number, number, number, number, number, number, number,
];
/** The unit of intensities, as files of splats name it. */
export type Unit = 'hu' | 'arbitrary' | 'luminance';

// ---- What the file carries (written by `vgs convert`, src/scene.rs; read by scene.ts) --------------------------------

/** Colour, opacity per mm and light over the intensity (engine/transfer/src/function.rs). */
export interface TransferFunction {
    name: string;
    /** [intensity, red, green, blue], 0 to 1, display-referred, by rising intensity. */
    colours: [number, number, number, number][];
    /** [intensity, opacity per mm], by rising intensity. */
    opacities: [number, number][];
    /** [gradient magnitude, factor of the opacity]; none: the opacity does not depend on it. */
    gradientOpacities: [number, number][];
    material: Material;
}

export interface Material {
    shade: boolean;
    ambient: number;
    diffuse: number;
    specular: number;
    power: number;
    /** Strength of the ambient occlusion, 0 to 1. */
    occlusion: number;
}

/** How an object is shown (engine/render/src/look.rs). */
export interface Appearance {
    visible: boolean;
    /** A colour, 0 to 1, in place of the function's. */
    tint: Vec3 | null;
    /** Factor of the opacity per mm, 0 to 1. */
    opacity: number;
    /** A transfer function of its own. */
    function: TransferFunction | null;
}

export interface SceneObject extends Appearance {
    /** The label that voxels have. */
    number: number;
    name: string;
}

/** Points with normal · x < offset are cut away; normal is a unit vector. */
export interface Plane {
    normal: Vec3;
    offset: number;
}

/** Where the key light is: a direction to the right, up and towards the viewer, or RAS (engine/transfer/src/light.rs). */
export interface Light {
    direction: Vec3;
    fixedTo: 'camera' | 'patient';
    /** Share of a second light, mirrored from left to right. */
    fill: number;
}

export interface Camera {
    eye: Vec3;
    target: Vec3;
    up: Vec3;
    /** Vertical field of view, degrees. */
    fieldOfView: number;
}

/** One set of splats, or a field, that the file carries. */
export interface Part {
    /** `vgs`: a file of that format; `voxels`: a decoded field (field/voxels.ts). */
    kind: 'vgs' | 'voxels';
    /** Bytes before they were written as text. */
    bytes: number;
    /** Number of the object of each label of the part: [label, number]; without labels the label is 0. */
    numbers: [number, number][];
}

export interface Scene {
    /** "vgs 0.3.0" */
    program: string;
    title: string;
    unit: Unit;
    parts: Part[];
    objects: SceneObject[];
    function: TransferFunction;
    presets: TransferFunction[];
    light: Light;
    clip: Plane[];
    camera: Camera;
    /** Display-referred, 0 to 1. */
    background: Vec3;
}

// ---- What the worker makes of it (field/) -----------------------------------------------------------------------------

/**
 * A decoded field as the march reads it (shaders-glsl/include/medium.glsl, engine/render/src/atlas.rs): bricks of 8³
 * voxels with an apron of one, 9³ texels, side by side in a volume image.
 */
export interface Atlas {
    /** Voxels of the box, with an empty border of one voxel. */
    size: Vec3;
    /** Voxel of the box to mm RAS. */
    worldFromVoxel: Affine;
    /** Mean edge of a voxel of the CT's grid, mm. */
    edge: number;
    /** Least and greatest V, over the voxels that splats reach, as `vgs` has it (GpuVolume::range). */
    range: [number, number];
    /** What is added to the V of a texel times `scale`. */
    middle: number;
    /** A power of two: 1, unless V are so far apart, or so near together, that halves would not hold them. */
    scale: number;
    /** Bricks of 8³ voxels along x, y, z; brick b has the voxels 8 b - 1 to 8 b + 7. */
    bricks: Vec3;
    /** Place of each brick in the atlas, ten bits an axis, x fastest; 0 is the empty one. */
    places: Uint32Array;
    /** Coordinates of the brick at each place of the atlas, x fastest, ten bits an axis; 0xffffffff: none. */
    brickAt: Uint32Array;
    /** Texels of the image along x, y, z. */
    dims: Vec3;
    /** V less `middle`, over `scale`, and O, as halves: two for each texel. */
    texels: Uint16Array;
    /** Label of each texel, and 255 if all in its cell has that label: two for each texel; null if there is one label. */
    labels: Uint8Array | null;
    /** The label if there is one. */
    label: number;
    /** The grid of small bricks by which empty space is leapt over (engine/render/src/gpu_volume.rs, brick_grid). */
    leaps: {
        /** Logarithm to base 2 of their edges, voxels. */
        shift: Vec3;
        bricks: Vec3;
        /** Least and greatest V of what is read there; the least above the greatest: nothing is there. */
        intervals: Float32Array;
    };
    /** Number of voxels with O above one half over 256 equal steps of `range`, of each object. */
    histograms: Map<number, Uint32Array>;
    /** Number of splats; 0 if it is not known. */
    splats: number;
    /** ms that each stage took. */
    times: Record<string, number>;
}

/** From the page to the worker, and back. */
export type ToWorker = { parts: (Part & { data: Uint8Array })[] };
export type FromWorker =
    | { progress: number; stage: string }
    | { atlas: Atlas }
    /** In words for a reader of the page. */
    | { error: string };

// ---- Drawing (render/) ------------------------------------------------------------------------------------------------

/** One eye, mm RAS. As in shaders-glsl/include/view.glsl. */
export interface View {
    eye: Vec3;
    /** Unit vectors. */
    right: Vec3;
    up: Vec3;
    /** The viewing direction. */
    forward: Vec3;
    /** x/z of the left and right edge, y/z of the upper and lower edge of the picture. */
    tangents: [left: number, right: number, upper: number, lower: number];
}

/** Pixels from the lower left corner of a framebuffer. */
export interface Port {
    x: number;
    y: number;
    width: number;
    height: number;
}

/** All that can change while a scene is viewed, but for the view. */
export interface Look {
    function: TransferFunction;
    /** By the number of the object; one that is not there looks as the function makes it look. */
    objects: Map<number, Appearance>;
    clip: Plane[];
    light: Light;
    background: Vec3;
}

/** What a picture costs. */
export interface Quality {
    /** Distance of samples, in shortest edges of a voxel. */
    step: number;
    /** Length of the cells whose ends are sampled first; null: as long as suits the step. */
    cell: number | null;
    occlusion: boolean;
}

/** What lies under a place of a picture. */
export interface Pick {
    /** mm RAS. */
    place: Vec3;
    /** V there, in the unit of the scene. */
    value: number;
    /** Number of the object there. */
    object: number;
}
