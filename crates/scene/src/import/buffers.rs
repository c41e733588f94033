//! The bytes of a document's buffers.

/// Every buffer of a document, cut to its declared length. A file that several of them name is held once.
#[derive(Default)]
pub struct Buffers<'a> {
    pub(super) files: Vec<Vec<u8>>,
    pub(super) buffers: Vec<Buffer<'a>>,
}

/// Where one's bytes are.
pub(super) enum Buffer<'a> {
    /// The GLB's binary chunk.
    Chunk(&'a [u8]),
    /// One of the files, and how much of it.
    File(usize, usize),
}

impl Buffers<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.buffers.len()
    }

    /// The bytes of one.
    pub fn get(&self, index: usize) -> Option<&[u8]> {
        match self.buffers.get(index)? {
            Buffer::Chunk(bytes) => Some(bytes),
            Buffer::File(file, length) => self.files.get(*file)?.get(..*length),
        }
    }

    /// The bytes of all of them, in order.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.len()).filter_map(|index| self.get(index))
    }
}
