// Reads pixels without waiting: a frame that is under way is not held up.

/** Pixels of the bound framebuffer, from its lower left corner, into `pixels`. Rejects if the context is lost. */
export async function read(
    gl: WebGL2RenderingContext, width: number, height: number, format: number, type: number,
    pixels: Uint8Array | Uint32Array,
): Promise<void> {
    const buffer = gl.createBuffer()!;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, pixels.byteLength, gl.STREAM_READ);
    gl.readPixels(0, 0, width, height, format, type, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0)!;
    gl.flush();
    while (!gl.isContextLost() && gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED)
        await new Promise((done) => setTimeout(done, 2));
    if (gl.isContextLost()) throw new Error('The graphics driver was reset.');
    gl.deleteSync(sync);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, pixels);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.deleteBuffer(buffer);
}
