//! A window's surface and its swapchain: images that are acquired for a frame each, drawn over, and shown.

use std::sync::Arc;

use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::{Context, Format, Gpu, Image, Recorder, Ticket, check, lock};
use base::error::{Error, Kind, Result};

/// A window's surface, in which a program draws. One frame is in flight at a time: [`Surface::acquire`] waits
/// for the one before, so that the host prepares a frame while the device draws the last one.
pub struct Surface {
    swapchain: Option<Swapchain>,
    loader: khr::swapchain::Device,
    queries: khr::surface::Instance,
    handle: vk::SurfaceKHR,
    format: (Format, vk::ColorSpaceKHR),
    /// Signalled when the acquired picture may be written.
    acquired: vk::Semaphore,
    /// The size that the window wants, pixels.
    wanted: [u32; 2],
    /// True if the swapchain no longer fits the window.
    stale: bool,
    last: Option<Ticket>,
    gpu: Gpu,
    /// The surface may not outlive its window.
    _window: Box<dyn std::any::Any>,
}

struct Swapchain {
    handle: vk::SwapchainKHR,
    pictures: Vec<Image>,
    /// Semaphore of each picture, signalled when it may be shown.
    drawn: Vec<vk::Semaphore>,
    size: [u32; 2],
}

/// An image of the swapchain that the program may draw to until it is presented.
pub struct Acquired(u32);

impl Surface {
    /// Creates the surface of a window. The device must have been booted for its display
    /// ([`super::GpuOptions::windows`]). `size` is in pixels.
    ///
    /// # Errors
    /// [`Kind::Unavailable`] if the device cannot show pictures in this window.
    pub fn new<W>(gpu: &Gpu, window: Arc<W>, size: [u32; 2]) -> Result<Self>
    where
        W: HasDisplayHandle + HasWindowHandle + 'static,
    {
        let context: &Context = &gpu.0;
        let unavailable = |what: &str| {
            Error::new(Kind::Unavailable, "VGS-GPU-060", format!("{}: {what}", context.description.name))
                .help("choose another --device, or write pictures to files with `vgs render`")
        };
        let no_window = |_| unavailable("the window is gone");
        let display = window.display_handle().map_err(no_window)?.as_raw();
        let pane = window.window_handle().map_err(no_window)?.as_raw();
        let instance = &context.instance;
        let queries = khr::surface::Instance::new(&instance.entry, &instance.handle);
        // SAFETY: the instance was made with the extensions of this display, and the handles are alive.
        let handle = check("the surface of the window", unsafe {
            ash_window::create_surface(&instance.entry, &instance.handle, display, pane, None)
        })?;
        let semaphore = vk::SemaphoreCreateInfo::default();
        // From here on `Drop` cleans up.
        let mut surface = Surface {
            swapchain: None,
            loader: khr::swapchain::Device::new(&instance.handle, &context.device),
            queries,
            handle,
            format: (Format::Bgra8, vk::ColorSpaceKHR::SRGB_NONLINEAR),
            acquired: vk::Semaphore::null(),
            wanted: size,
            stale: true,
            last: None,
            gpu: gpu.clone(),
            _window: Box::new(window),
        };
        // SAFETY: the device is live.
        surface.acquired =
            check("creating a semaphore", unsafe { context.device.create_semaphore(&semaphore, None) })?;
        // SAFETY: surface and physical device are of the same instance.
        let (shows, formats) = unsafe {
            let queries = &surface.queries;
            (
                queries.get_physical_device_surface_support(context.physical, context.queue_family, handle),
                queries.get_physical_device_surface_formats(context.physical, handle),
            )
        };
        if !check("asking the surface", shows)? {
            return Err(unavailable("it cannot show pictures in this window"));
        }
        surface.format = pick_format(&check("asking the surface", formats)?)
            .ok_or_else(|| unavailable("this window takes no pictures of 8 bits a channel"))?;
        Ok(surface)
    }

    /// Returns the format of its images. It is sRGB in the sense of [`Format::is_srgb`] only if the window
    /// has nothing else.
    pub fn format(&self) -> Format {
        self.format.0
    }

    /// Follows the window to another size, pixels; 0 if it is minimised.
    pub fn resize(&mut self, size: [u32; 2]) {
        self.stale |= size != self.wanted;
        self.wanted = size;
    }

    /// Acquires the next image when the frame before is finished. Returns `None` while the window is
    /// minimised or between two sizes; the caller asks again when the window wants to be drawn.
    pub fn acquire(&mut self) -> Result<Option<Acquired>> {
        if let Some(ticket) = self.last.take()
            && !self.gpu.has_finished(ticket)?
        {
            self.gpu.wait(ticket)?;
        }
        self.acquire_within(u64::MAX)
    }

    /// Acquires the next image if there is one at once. Returns `None` also while the frame before is not
    /// finished. Waits only if the window has another size.
    pub fn acquire_at_once(&mut self) -> Result<Option<Acquired>> {
        if let Some(ticket) = self.last {
            if !self.gpu.has_finished(ticket)? {
                return Ok(None);
            }
            self.last = None;
        }
        self.acquire_within(0)
    }

    /// Acquires the next image within `timeout_ns` nanoseconds.
    fn acquire_within(&mut self, timeout_ns: u64) -> Result<Option<Acquired>> {
        // The second attempt is for a swapchain that has turned out to be too old.
        for _ in 0..2 {
            if self.stale {
                self.rebuild()?;
            }
            let Some(swapchain) = &self.swapchain else { return Ok(None) };
            // SAFETY: the semaphore is not pending: the submission that waited for it has finished.
            let asked = unsafe {
                self.loader.acquire_next_image(swapchain.handle, timeout_ns, self.acquired, vk::Fence::null())
            };
            match asked {
                Ok((index, suboptimal)) => {
                    self.stale = suboptimal;
                    return Ok(Some(Acquired(index)));
                }
                Err(vk::Result::NOT_READY | vk::Result::TIMEOUT) => return Ok(None),
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.stale = true,
                Err(e) => return check("asking for a picture of the window", Err(e)),
            }
        }
        Ok(None)
    }

    /// Records the acquisition of the image to draw over, once a frame, and returns it. Its content is
    /// undefined until all of it was drawn over.
    pub fn image(&mut self, recorder: &mut Recorder, acquired: &Acquired) -> &mut Image {
        let swapchain = self.swapchain.as_mut().expect("what was acquired has a swapchain");
        let picture = &mut swapchain.pictures[acquired.0 as usize];
        recorder.acquire_image(picture);
        picture
    }

    /// Submits the frame to the device and presents the image in the window.
    pub fn present(&mut self, mut recorder: Recorder, acquired: Acquired) -> Result<Ticket> {
        let context = &self.gpu.0;
        let swapchain = self.swapchain.as_ref().expect("what was acquired has a swapchain");
        let index = acquired.0 as usize;
        recorder.release_image(&swapchain.pictures[index]);
        let drawn = [swapchain.drawn[index]];
        let ticket = recorder.submit_between(Some(self.acquired), Some(drawn[0]))?;
        self.last = Some(ticket);
        let (chains, indices) = ([swapchain.handle], [acquired.0]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&drawn).swapchains(&chains).image_indices(&indices);
        let queue = lock(&context.queue);
        // SAFETY: the queue is ours alone while locked; the picture is in the layout for it.
        match unsafe { self.loader.queue_present(queue.queue, &info) } {
            Ok(suboptimal) => self.stale |= suboptimal,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.stale = true,
            Err(e) => check("showing a picture", Err(e))?,
        }
        Ok(ticket)
    }

    /// Creates the swapchain anew, in the size that the window has.
    fn rebuild(&mut self) -> Result<()> {
        let context = Arc::clone(&self.gpu.0);
        // SAFETY: surface and physical device are of the same instance.
        let asked =
            unsafe { self.queries.get_physical_device_surface_capabilities(context.physical, self.handle) };
        let can = check("asking the surface", asked)?;
        let size = extent(&can, self.wanted);
        // The pictures in flight belong to the old one.
        self.gpu.wait_idle()?;
        let old = self.swapchain.take();
        if size.contains(&0) {
            self.destroy(old);
            return Ok(());
        }
        let most = if can.max_image_count == 0 { u32::MAX } else { can.max_image_count };
        let alpha = [vk::CompositeAlphaFlagsKHR::OPAQUE, vk::CompositeAlphaFlagsKHR::INHERIT]
            .into_iter()
            .find(|&alpha| can.supported_composite_alpha.contains(alpha))
            .unwrap_or(vk::CompositeAlphaFlagsKHR::PRE_MULTIPLIED);
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.handle)
            .min_image_count((can.min_image_count + 1).min(most))
            .image_format(self.format.0.vk())
            .image_color_space(self.format.1)
            .image_extent(vk::Extent2D { width: size[0], height: size[1] })
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(can.current_transform)
            .composite_alpha(alpha)
            // Every device has this mode; it is no faster than the screen.
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true)
            .old_swapchain(old.as_ref().map_or(vk::SwapchainKHR::null(), |old| old.handle));
        // SAFETY: nothing of the old swapchain is in use.
        let made = unsafe { self.loader.create_swapchain(&info, None) };
        self.destroy(old);
        let handle = check("the swapchain of the window", made)?;
        // The swapchain is complete from here on, so that `Drop` finds all that exists.
        let swapchain =
            self.swapchain.insert(Swapchain { handle, pictures: Vec::new(), drawn: Vec::new(), size });
        // SAFETY: the swapchain is new; semaphores and pictures go before it.
        unsafe {
            for image in check("the swapchain of the window", self.loader.get_swapchain_images(handle))? {
                let release_layout = vk::ImageLayout::PRESENT_SRC_KHR;
                let format = self.format.0;
                swapchain.pictures.push(self.gpu.external_image(
                    "window",
                    image,
                    format,
                    size,
                    1,
                    release_layout,
                )?);
                let semaphore = vk::SemaphoreCreateInfo::default();
                swapchain
                    .drawn
                    .push(check("creating a semaphore", context.device.create_semaphore(&semaphore, None))?);
            }
        }
        self.stale = false;
        Ok(())
    }

    /// Returns width and height of its images, pixels; 0 while the window is minimised.
    pub fn size(&self) -> [u32; 2] {
        self.swapchain.as_ref().map_or([0, 0], |swapchain| swapchain.size)
    }

    /// Destroys a swapchain that nothing uses any more.
    fn destroy(&self, swapchain: Option<Swapchain>) {
        let Some(Swapchain { handle, pictures, drawn, .. }) = swapchain else { return };
        drop(pictures);
        let context = &self.gpu.0;
        let queue = lock(&context.queue);
        // SAFETY: presenting counts as using semaphores and pictures, and the queue is idle after the wait.
        unsafe {
            let _ = context.device.queue_wait_idle(queue.queue);
            // The views of its pictures go first.
            lock(&context.memory).delete_passed(&context.device, queue.last_value());
            for semaphore in drawn {
                context.device.destroy_semaphore(semaphore, None);
            }
            self.loader.destroy_swapchain(handle, None);
        }
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        let swapchain = self.swapchain.take();
        self.destroy(swapchain);
        let context = &self.gpu.0;
        let _queue = lock(&context.queue);
        // SAFETY: after the wait nothing uses what is destroyed; a null semaphore is ignored.
        unsafe {
            let _ = context.device.device_wait_idle();
            context.device.destroy_semaphore(self.acquired, None);
            self.queries.destroy_surface(self.handle, None);
        }
    }
}

/// Picks a format. Display-referred numbers are shown without a conversion; if a window insists on sRGB
/// formats, drawings convert them to light.
fn pick_format(offered: &[vk::SurfaceFormatKHR]) -> Option<(Format, vk::ColorSpaceKHR)> {
    let space = vk::ColorSpaceKHR::SRGB_NONLINEAR;
    [Format::Bgra8, Format::Rgba8, Format::Sbgra8, Format::Srgba8]
        .into_iter()
        .find(|format| offered.iter().any(|o| o.format == format.vk() && o.color_space == space))
        .map(|format| (format, space))
}

/// Returns the size that the surface dictates, or the one that the window wants if the surface leaves the
/// choice.
fn extent(can: &vk::SurfaceCapabilitiesKHR, wanted: [u32; 2]) -> [u32; 2] {
    let current = can.current_extent;
    if current.width != u32::MAX {
        return [current.width, current.height];
    }
    if wanted.contains(&0) {
        return [0, 0];
    }
    let (least, most) = (can.min_image_extent, can.max_image_extent);
    [wanted[0].clamp(least.width, most.width), wanted[1].clamp(least.height, most.height)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn capabilities(current: [u32; 2]) -> vk::SurfaceCapabilitiesKHR {
        let extent = |[width, height]: [u32; 2]| vk::Extent2D { width, height };
        vk::SurfaceCapabilitiesKHR {
            current_extent: extent(current),
            min_image_extent: extent([16, 16]),
            max_image_extent: extent([4096, 2048]),
            ..Default::default()
        }
    }

    #[test]
    fn the_surface_dictates_the_size_or_the_window_does() {
        let free = [u32::MAX, u32::MAX];
        for (current, wanted, expect) in [
            ([800, 600], [640, 480], [800, 600]),
            ([0, 0], [640, 480], [0, 0]),
            (free, [640, 480], [640, 480]),
            (free, [0, 0], [0, 0]),
            (free, [9000, 9000], [4096, 2048]),
            (free, [1, 1], [16, 16]),
        ] {
            assert_eq!(extent(&capabilities(current), wanted), expect, "{current:?} {wanted:?}");
        }
    }

    #[test]
    fn plain_formats_are_preferred() {
        let offer = |formats: &[vk::Format]| {
            let rows: Vec<_> = formats
                .iter()
                .map(|&format| vk::SurfaceFormatKHR {
                    format,
                    color_space: vk::ColorSpaceKHR::SRGB_NONLINEAR,
                })
                .collect();
            pick_format(&rows).map(|(format, _)| format)
        };
        let (srgb, plain) = (vk::Format::B8G8R8A8_SRGB, vk::Format::R8G8B8A8_UNORM);
        assert_eq!(offer(&[srgb, plain]), Some(Format::Rgba8));
        assert_eq!(offer(&[srgb]), Some(Format::Sbgra8));
        assert_eq!(offer(&[vk::Format::R5G6B5_UNORM_PACK16]), None);
    }
}
