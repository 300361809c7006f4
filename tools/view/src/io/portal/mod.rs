//! The file dialog of the desktop: the chooser of its portal, which any desktop can bring, over D-Bus.
//!
//! The interface is [org.freedesktop.portal.FileChooser](https://flatpak.github.io/xdg-desktop-portal/docs/).

mod portal;

pub use portal::ask;
