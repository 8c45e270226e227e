//! The `softtissue` command; everything is in `softtissue-cli`.

/// Large tensors come and go every training step; glibc returns each to the system, mimalloc keeps them.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    softtissue_cli::main()
}
