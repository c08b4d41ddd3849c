"""An avascular tumour of two phases and oxygen. This release holds no tumour model yet; the plaque is in `plaque1d`."""
