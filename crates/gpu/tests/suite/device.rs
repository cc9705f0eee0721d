//! Choosing an adapter, and what happens without one.

use incise_gpu::{GpuContext, GpuError, GpuOptions, wgpu};

use crate::support::gpu;

#[test]
fn an_adapter_is_found_by_a_part_of_its_name() {
    let Some(gpu) = gpu("an_adapter_is_found_by_a_part_of_its_name") else {
        return;
    };
    let all = GpuContext::adapters(&GpuOptions::default());
    let name = gpu.adapter().name.to_uppercase();
    assert!(
        all.iter()
            .any(|adapter| adapter.name.to_uppercase() == name)
    );
    let options = GpuOptions {
        adapter: Some(name[..name.len() / 2].to_owned()),
        ..GpuOptions::from_env()
    };
    let again = GpuContext::new(&options).expect("it was found before");
    assert!(
        again
            .adapter()
            .name
            .to_uppercase()
            .starts_with(&name[..name.len() / 2])
    );
}

#[test]
fn an_unknown_adapter_is_an_error_that_names_the_others() {
    let options = GpuOptions {
        adapter: Some("no such thing".into()),
        ..GpuOptions::default()
    };
    let Err(GpuError::NoAdapter { reason, found }) = GpuContext::new(&options) else {
        panic!("there is no such adapter");
    };
    assert!(reason.contains("no such thing"));
    for adapter in GpuContext::adapters(&GpuOptions::default()) {
        assert!(found.contains(&adapter.name));
    }
}

#[test]
fn without_drivers_there_is_an_error_and_no_panic() {
    let options = GpuOptions {
        backends: Some(wgpu::Backends::empty()),
        ..GpuOptions::default()
    };
    let error = GpuContext::new(&options).expect_err("no device was asked for");
    assert!(matches!(error, GpuError::NoAdapter { .. }), "{error}");
}

#[test]
fn a_lost_device_is_an_error_and_no_panic() {
    if gpu("a_lost_device_is_an_error_and_no_panic").is_none() {
        return;
    }
    // One of its own, since it is destroyed.
    let gpu = GpuContext::new(&GpuOptions::from_env()).expect("there is one");
    gpu.device().destroy();
    let error = gpu.wait().expect_err("it is gone");
    assert!(matches!(error, GpuError::Lost { .. }), "{error}");
    assert_eq!(gpu.check(), Err(error));
}
