//! The page that `vgs page` fills is what its sources and the engine's shaders make. Without Node.js and its packages
//! (`tools/setup page`) this is left out.

use std::process::Command;

#[test]
fn the_page_is_made_of_its_sources() {
    let Some(folder) = super::set_up("page") else { return };
    let web = super::root().join("tools/page/web");
    if !web.join("node_modules").exists() {
        eprintln!("left out: `tools/setup page` gets the packages that this needs, for each checkout");
        return;
    }
    let status = Command::new(folder.join("node/bin/node"))
        .arg(web.join("build.mjs"))
        .arg("--check")
        .status()
        .expect("Node.js");
    assert!(status.success(), "bundle/page.html is not what the sources make: see above");
}
