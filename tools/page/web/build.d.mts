/** The text of a script with all that it imports. */
export function script(entry: string, minify?: boolean): Promise<string>;
/** Bytes as text (text.ts). */
export function asText(bytes: Uint8Array): string;
/** The page, with places for a title and a scene. */
export function page(): Promise<string>;
