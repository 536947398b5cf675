import { defineConfig } from 'vite';

// One script, one style sheet, one document; relative addresses, so that any folder serves it.
export default defineConfig({
  base: './',
  build: {
    target: 'es2022',
    modulePreload: false,
    chunkSizeWarningLimit: 900,
    rollupOptions: {
      output: { entryFileNames: 'assets/page.js', assetFileNames: 'assets/page[extname]', inlineDynamicImports: true },
    },
  },
});
