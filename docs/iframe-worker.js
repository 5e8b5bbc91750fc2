// Browsers refuse workers in pages opened from the disk: there the search runs in a hidden frame instead.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      this.ready = new Promise((resolve) => {
        const frame = document.createElement("iframe")
        frame.hidden = true
        document.body.append(frame)
        this.inner = frame.contentWindow
        this.inner.postMessage = (data) => {
          const message = new MessageEvent("message", { data })
          this.dispatchEvent(message)
          this.onmessage?.(message)
        }
        this.inner.importScripts = () => {}
        const script = frame.contentDocument.createElement("script")
        script.src = url
        script.onload = resolve
        frame.contentDocument.body.append(script)
      })
    }
    postMessage(data) {
      this.ready.then(() => this.inner.dispatchEvent(new MessageEvent("message", { data })))
    }
    terminate() {}
  }
}
