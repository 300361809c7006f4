//! The device of a test: validation layers on, and any message of theirs fails the test.

use std::ops::Deref;

use engine::gpu::{Gpu, GpuOptions, MessageLog};

/// Environment variable: set to 1, tests run without validation layers and say so. Otherwise a missing layer
/// fails every GPU test.
const NO_VALIDATION: &str = "VGS_TEST_NO_VALIDATION";

/// A booted device. On drop it checks that the validation layers have reported nothing: also, if nobody else
/// has a part of it, that nothing is left when it is destroyed.
pub struct Device {
    /// `None` only inside `Drop`.
    gpu: Option<Gpu>,
    messages: MessageLog,
}

impl Device {
    /// Boots the default device.
    ///
    /// # Panics
    /// If there is no device, or no validation layer: a GPU test never skips itself.
    pub fn boot() -> Self {
        Self::boot_with(GpuOptions::default())
    }

    /// Boots a device with these options, validation on.
    pub fn boot_with(options: GpuOptions) -> Self {
        let messages = options.messages.clone();
        match Gpu::new(&with_validation(options)) {
            Ok(gpu) => Device { gpu: Some(gpu), messages },
            Err(e) => panic!(
                "this test needs a Vulkan device and the Khronos validation layer: {e} ({}); `tools/setup run test` \
                 installs both, `tools/test` runs the tests with them",
                e.help
            ),
        }
    }
}

impl Deref for Device {
    type Target = Gpu;

    fn deref(&self) -> &Gpu {
        self.gpu.as_ref().expect("it is there until it is dropped")
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // Work in flight may still cause messages. A second panic would hide the first.
        if std::thread::panicking() {
            return;
        }
        if let Err(e) = self.wait_idle() {
            panic!("the device failed at the end of the test: {e}");
        }
        self.gpu = None;
        assert_silent(&self.messages);
    }
}

/// Returns the options with the validation layers on, unless the environment turns them off.
pub fn with_validation(options: GpuOptions) -> GpuOptions {
    let validation = std::env::var_os(NO_VALIDATION).is_none_or(|v| v != "1");
    if !validation {
        println!("{NO_VALIDATION}=1: the validation layers are off, this run checks less");
    }
    GpuOptions { validation, ..options }
}

/// Checks that the validation layers have reported nothing.
///
/// # Panics
/// With what they have reported.
pub fn assert_silent(messages: &MessageLog) {
    // GPU-assisted validation tells what it turns on for itself.
    let of_itself = |message: &String| {
        message.contains("Internal Warning: ") || message.contains("GPU Assisted Validation")
    };
    let mut messages = messages.all();
    messages.retain(|message| !of_itself(message));
    assert!(messages.is_empty(), "validation layers: {} messages\n{}", messages.len(), messages.join("\n"));
}

#[cfg(test)]
mod tests {
    use engine::gpu::Kernel;

    use super::*;

    /// The guard and the layers are alive: a workgroup larger than any device allows is reported.
    #[test]
    #[should_panic(expected = "validation layers: ")]
    fn a_message_of_the_layers_fails_a_test() {
        let gpu = Device::boot();
        let _ = Kernel::new(&gpu, &shaders_glsl::SPLAT_TO_VOLUME, &[0, 1 << 20]);
    }
}
