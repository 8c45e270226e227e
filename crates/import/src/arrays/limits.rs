/// What a reader of arrays is willing to accept. Every number that a file states is held against these before memory
/// is taken for it.
#[derive(Clone, Copy, Debug)]
pub struct ArrayLimits {
    /// Bytes of one file. Default 512 MiB.
    pub file_bytes: u64,
    /// Bytes of one array, after it is inflated. Default 384 MiB.
    pub array_bytes: u64,
    /// Members of one archive. Default 20,000.
    pub members: usize,
    /// How many times its stored size a member may inflate to, where it is larger than 16 MiB. Default 250.
    pub inflate_ratio: u64,
    /// Dimensions of one array. Default 8.
    pub dimensions: usize,
}

impl Default for ArrayLimits {
    fn default() -> Self {
        Self { file_bytes: 512 << 20, array_bytes: 384 << 20, members: 20_000, inflate_ratio: 250, dimensions: 8 }
    }
}
