// What the build makes (build.mjs).
declare module 'shaders' {
    const texts: Record<'library' | 'march' | 'pick' | 'slice' | 'gradients' | 'whole', string>;
    export default texts;
}
declare module 'quality-levels' {
    /** Those of splats that were fitted for a grid, in engine/render/src/quality_levels.toml. */
    const levels: { resolution: number; coarseness: number; cost: number }[];
    export default levels;
}
declare module 'worker-text' {
    const text: string;
    export default text;
}
