// @ts-check
// Where the service is: the page may lie below a path that a proxy adds. Addresses are written as if there were none.

/** The path of the service, with a slash at its end: modules lie in assets/DIGEST/FOLDER below it. */
const ROOT = new URL("../../../", import.meta.url).pathname;

/**
 * An address of the service, as `/docs`, where this page finds it; others as they are.
 * @param {string} address
 */
export const at = (address) => (address.startsWith("/") ? ROOT + address.slice(1) : address);

/** @type {(address: string) => string} the service's own address of one that an answer names */
export const own = (address) => (address.startsWith(ROOT) ? `/${address.slice(ROOT.length)}` : address);

/** The service's address for a command, without a slash at its end. */
export const here = () => (location.origin + ROOT).replace(/\/$/, "");
