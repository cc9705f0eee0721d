//! [`GpuContext`]: a device, its queue, and the count of transfers.
//!
//! One context serves a process: kernels, solvers and renderers share it. The adapter is chosen here instead of by
//! wgpu's helpers, which panic when a requirement cannot be met. Errors that a driver reports later (device lost,
//! rejected command) are kept and returned by the next call that can return an error; none of them panics.

use std::sync::{Arc, Mutex, PoisonError};

use pollster::block_on;
use wgpu::{
    Adapter, Backends, Device, DeviceType, Features, Limits, PollType, Queue, SubmissionIndex,
};

use crate::GpuError;
use crate::traffic::{Counters, Traffic, count};

/// Options for the choice of an adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// A part of the adapter's name, in any case; `None` takes the first in the order discrete, integrated, virtual,
    /// software.
    pub adapter: Option<String>,
    /// The interfaces to search; `None` searches those of Vulkan, Metal and Direct3D 12 that are compiled in.
    pub backends: Option<Backends>,
}

impl GpuOptions {
    /// Options from the environment: `WGPU_ADAPTER_NAME` and `WGPU_BACKEND` (`vulkan`, `metal`, `dx12`, `gl`, separated
    /// by commas).
    #[must_use]
    pub fn from_env() -> Self {
        let adapter = std::env::var("WGPU_ADAPTER_NAME").ok();
        Self {
            adapter: adapter.filter(|name| !name.is_empty()),
            backends: Backends::from_env(),
        }
    }
}

/// Name, interface and driver of an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct AdapterDescription {
    /// The name reported by the driver.
    pub name: String,
    /// The interface: `vulkan`, `metal`, `dx12`, `gl`.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// True for a software renderer that runs on the CPU.
    pub software: bool,
}

impl AdapterDescription {
    fn of(info: &wgpu::AdapterInfo) -> Self {
        Self {
            name: info.name.clone(),
            backend: info.backend.to_string(),
            driver: format!("{} {}", info.driver, info.driver_info)
                .trim()
                .to_owned(),
            software: info.device_type == DeviceType::Cpu,
        }
    }
}

/// The error that a driver reported outside of any call that could return it.
type Report = Arc<Mutex<Option<GpuError>>>;

/// A device with its queue.
#[derive(Debug)]
pub struct GpuContext {
    device: Device,
    queue: Queue,
    description: AdapterDescription,
    report: Report,
    counters: Counters,
    /// Staging buffers kept for reuse, since creating one may take a driver longer than a copy.
    spares: Mutex<Vec<wgpu::Buffer>>,
}

/// Largest number of staging buffers kept.
const SPARES: usize = 16;

impl GpuContext {
    /// Opens the adapter that matches the options best.
    ///
    /// A browser opens devices asynchronously: pass an opened one to [`GpuContext::from_device`].
    ///
    /// Kernels stay within WebGPU's default limits except for the size of buffers, of which the device's maximum is
    /// requested.
    ///
    /// # Errors
    ///
    /// [`GpuError::NoAdapter`] with the adapters found; [`GpuError::Refused`] with the driver's message.
    ///
    /// # Example
    /// ```
    /// use incise_gpu::{GpuContext, GpuError, GpuOptions};
    ///
    /// match GpuContext::new(&GpuOptions::from_env()) {
    ///     Ok(gpu) => println!("{}", gpu.adapter().name),
    ///     Err(GpuError::NoAdapter { reason, .. }) => println!("none: {reason}"),
    ///     Err(other) => return Err(other),
    /// }
    /// # Ok::<(), GpuError>(())
    /// ```
    pub fn new(options: &GpuOptions) -> Result<Self, GpuError> {
        let adapter = choose(options)?;
        let info = adapter.get_info();
        let opened = block_on(adapter.request_device(&Self::descriptor(&adapter)));
        let (device, queue) = opened.map_err(|error| GpuError::Refused {
            adapter: info.name.clone(),
            message: error.to_string(),
        })?;
        Ok(Self::from_device(device, queue))
    }

    /// The device descriptor required for computing, for renderers that open the device: WebGPU's default limits, the
    /// largest buffers available, and timestamps if available.
    #[must_use]
    pub fn descriptor(adapter: &Adapter) -> wgpu::DeviceDescriptor<'static> {
        let present = adapter.limits();
        wgpu::DeviceDescriptor {
            label: Some("incise"),
            required_features: adapter.features() & Features::TIMESTAMP_QUERY,
            required_limits: Limits {
                max_buffer_size: present.max_buffer_size,
                max_storage_buffer_binding_size: present.max_storage_buffer_binding_size,
                ..Limits::default()
            },
            memory_hints: wgpu::MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        }
    }

    /// Wraps a device that other code has opened, typically a renderer, so that results can be drawn without a copy.
    /// The device must allow WebGPU's default limits, see [`GpuContext::descriptor`].
    #[must_use]
    pub fn from_device(device: Device, queue: Queue) -> Self {
        let report = Report::default();
        let uncaptured = Arc::clone(&report);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let message = error.to_string();
            note(&uncaptured, GpuError::Command { message });
        }));
        let lost = Arc::clone(&report);
        device.set_device_lost_callback(move |reason, message| {
            let message = format!("{reason:?}: {message}");
            note(&lost, GpuError::Lost { message });
        });
        Self {
            description: AdapterDescription::of(&device.adapter_info()),
            device,
            queue,
            report,
            counters: Counters::default(),
            spares: Mutex::default(),
        }
    }

    /// The available adapters, in order of preference.
    #[must_use]
    pub fn adapters(options: &GpuOptions) -> Vec<AdapterDescription> {
        let adapters = enumerate(options);
        adapters
            .iter()
            .map(|adapter| AdapterDescription::of(&adapter.get_info()))
            .collect()
    }

    /// Name, interface and driver of the adapter behind the device.
    #[must_use]
    pub fn adapter(&self) -> &AdapterDescription {
        &self.description
    }

    /// The device, for renderers that share it.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// The queue, for renderers that share it.
    #[must_use]
    pub fn queue(&self) -> &Queue {
        &self.queue
    }

    /// True if stages can be timed on the device.
    #[must_use]
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(Features::TIMESTAMP_QUERY)
    }

    /// The largest number of bytes of one buffer that a kernel can access.
    #[must_use]
    pub fn buffer_limit(&self) -> u64 {
        let limits = self.device.limits();
        limits
            .max_storage_buffer_binding_size
            .min(limits.max_buffer_size)
    }

    /// The transfers and dispatches since the device was opened.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.counters.read()
    }

    pub(crate) fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Creates a resource and returns it, or the error that the driver reports about it.
    ///
    /// In a browser, which cannot be waited for, the error is returned by a later [`GpuContext::check`].
    ///
    /// # Errors
    /// An error of this kind, reported while the resource was created.
    pub fn guarded<T>(
        &self,
        kind: wgpu::ErrorFilter,
        create: impl FnOnce(&Device) -> T,
    ) -> Result<T, wgpu::Error> {
        if cfg!(target_family = "wasm") {
            return Ok(create(&self.device));
        }
        let scope = self.device.push_error_scope(kind);
        let created = create(&self.device);
        match block_on(scope.pop()) {
            Some(error) => Err(error),
            None => Ok(created),
        }
    }

    /// Returns an error that the driver has reported since; from then on, results of the device are undefined.
    ///
    /// # Errors
    /// The first report.
    pub fn check(&self) -> Result<(), GpuError> {
        let report = self.report.lock().unwrap_or_else(PoisonError::into_inner);
        report.clone().map_or(Ok(()), Err)
    }

    /// Submits commands; returns the index to wait for.
    pub(crate) fn submit(
        &self,
        encoder: wgpu::CommandEncoder,
    ) -> Result<SubmissionIndex, GpuError> {
        let index = self.queue.submit([encoder.finish()]);
        count(&self.counters.submits, 1);
        self.check().map(|()| index)
    }

    /// A kept staging buffer for this many bytes, if one has a suitable size.
    pub(crate) fn spare(&self, bytes: u64) -> Option<wgpu::Buffer> {
        let mut spares = self.spares.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |buffer: &wgpu::Buffer| (bytes..=4 * bytes.max(1024)).contains(&buffer.size());
        let found = spares.iter().position(fits)?;
        Some(spares.swap_remove(found))
    }

    /// Keeps an unmapped staging buffer for the next copy.
    pub(crate) fn keep(&self, buffer: wgpu::Buffer) {
        let mut spares = self.spares.lock().unwrap_or_else(PoisonError::into_inner);
        if spares.len() == SPARES {
            spares.remove(0);
        }
        spares.push(buffer);
    }

    pub(crate) fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some(label) };
        self.device.create_command_encoder(&descriptor)
    }

    /// Waits until the device has done all submitted work.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.poll(PollType::wait_indefinitely())
    }

    /// Waits until the device has done this submission and all before it.
    pub(crate) fn wait_for(&self, submission: SubmissionIndex) -> Result<(), GpuError> {
        self.poll(PollType::Wait {
            submission_index: Some(submission),
            timeout: None,
        })
    }

    fn poll(&self, how: PollType) -> Result<(), GpuError> {
        let polled = self.device.poll(how);
        self.check()?;
        polled.map(|_| ()).map_err(|error| GpuError::Lost {
            message: error.to_string(),
        })
    }
}

/// Keeps the first report, since later ones are mostly its consequences.
fn note(report: &Report, error: GpuError) {
    let mut report = report.lock().unwrap_or_else(PoisonError::into_inner);
    // A lost device makes everything else fail, so this error replaces others.
    let replace = report.is_none() || matches!(error, GpuError::Lost { .. });
    if replace {
        *report = Some(error);
    }
}

/// All adapters, best first.
fn enumerate(options: &GpuOptions) -> Vec<Adapter> {
    let backends = options
        .backends
        .unwrap_or(Backends::VULKAN | Backends::METAL | Backends::DX12);
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        // The sizes of indirect dispatches come from our own kernels, which keep them within limits; validating each
        // costs another dispatch.
        flags: wgpu::InstanceFlags::default()
            .difference(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL)
            .with_env(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    if cfg!(target_family = "wasm") {
        return Vec::new();
    }
    let mut adapters = block_on(instance.enumerate_adapters(backends));
    // The sort is stable, so adapters of one kind stay in the driver's order.
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    });
    adapters
}

/// What is found where no adapter is.
const NO_ADAPTER: &str = if cfg!(target_family = "wasm") {
    "none (a browser opens a device asynchronously)"
} else {
    "none (is a driver installed?)"
};

fn choose(options: &GpuOptions) -> Result<Adapter, GpuError> {
    let adapters = enumerate(options);
    let names: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
    let wish = options.adapter.as_ref().map(|name| name.to_lowercase());
    let fits = |name: &String| {
        wish.as_ref()
            .is_none_or(|wish| name.to_lowercase().contains(wish))
    };
    let place = names.iter().position(fits);
    let found = if names.is_empty() {
        NO_ADAPTER.to_owned()
    } else {
        names.join(", ")
    };
    place
        .and_then(|place| adapters.into_iter().nth(place))
        .ok_or_else(|| GpuError::NoAdapter {
            reason: match &options.adapter {
                Some(name) => format!("no adapter has `{name}` in its name"),
                None => "no adapter answers".to_owned(),
            },
            found,
        })
}
